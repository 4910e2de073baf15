"""The closed loop: scenario, noise by counter, wind, and the flight kernel."""
