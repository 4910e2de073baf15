"""Faults planted in made flights, against which `flownav explain` is held: `make explain`."""
