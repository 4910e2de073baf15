"""What `flownav.core.compile` is made of; import it from there. With that module, the only code that knows Numba."""
