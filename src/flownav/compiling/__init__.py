"""What `flownav.compile` is made of; import it from there. With that module, the only code that knows Numba."""
