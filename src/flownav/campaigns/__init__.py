"""Many flights of one scenario: run, scored, summarised."""
