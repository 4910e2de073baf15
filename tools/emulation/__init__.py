"""The library on processors that are not this one: emulated by unicorn and wasmtime, for tests and for measuring."""
