"""A record in Rerun's viewer: the flight in space, its cameras, flow, errors and innovations on one time line."""
