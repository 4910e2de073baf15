"""Blackbox logs of Betaflight and INAV: `header` what a log says of itself, `frames` its frames, `reader` the Log."""
