"""Live: a MAVLink vehicle in real time through the filter, its estimate sent back; and a vehicle to try it with."""
