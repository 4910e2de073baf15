"""Studies of the library: means of inertial readings, and numbers of 32 bits."""
