"""Tuning: settings of the navigator proposed from logs, and judged on windows that the fit never saw."""
