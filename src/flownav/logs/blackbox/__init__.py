"""Blackbox logs of Betaflight and INAV: `header` a log's own description, `frames` its frames, `reader` the Log."""
