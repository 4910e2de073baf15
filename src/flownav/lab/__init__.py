"""The flow sensor measured: the pendulum rig, the optics, and identification from their logs and from flights."""
