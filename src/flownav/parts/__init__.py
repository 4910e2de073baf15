"""Parts that somebody else wrote: a filter, a sensor, a vehicle or a controller in one file, flown in place of ours."""
