"""Estimators: pure steps on lane buffers, used unchanged by simulation, replay and live."""
