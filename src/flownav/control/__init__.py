"""Guidance references and the autopilot, as equations."""
