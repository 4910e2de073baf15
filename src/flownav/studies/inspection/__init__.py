"""Inspection: what a log holds, and whether it can be trusted."""
