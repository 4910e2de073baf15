"""Modules behind `flownav.core.compile`; import from there. With that module, the only code that knows Numba."""
