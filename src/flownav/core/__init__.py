"""Foundations of all rooms: compiled equations, frames, records, and files read within limits and written whole."""
