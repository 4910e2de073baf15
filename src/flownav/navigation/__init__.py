"""Navigation: the landing filter fed with timed measurements of any source, for replay and live alike."""
