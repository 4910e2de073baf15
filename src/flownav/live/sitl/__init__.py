"""A real autopilot's simulator, flown on flownav's estimate: its program, its ground station, its faults, its score."""
