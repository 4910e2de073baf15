"""Flights of a real autopilot's simulator on flownav's estimate: its program, ground station, faults and score."""
