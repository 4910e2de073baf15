"""Speed, measured as a user would feel it: what `flownav bench` prints."""
