"""Comparison: many logs, many settings, and what else could have navigated, all scored alike."""
