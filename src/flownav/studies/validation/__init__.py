"""The simulator held against recorded flights: the same path, the same navigator, simulated sensors."""
