"""Many logs, flights and settings held against each other: comparison, tuning, validation, inspection, benchmark."""
