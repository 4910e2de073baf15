"""The judges: what a flight was worth, computed in one place from histories and records."""
