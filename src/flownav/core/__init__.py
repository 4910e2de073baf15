"""What everything stands on: compiled equations, frames, records, and files read within limits and written whole."""
