"""Why did it drift, and what cures it: hypotheses tried on a log, the first cause, and the parameters against it."""
