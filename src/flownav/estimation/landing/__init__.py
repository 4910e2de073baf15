"""The landing filter: an error-state filter of a vehicle above its pad (docs/landing-filter.md derives it)."""
