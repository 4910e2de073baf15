"""Faults: what a sensor does wrong, put into a log on purpose, and what a navigator makes of it."""
