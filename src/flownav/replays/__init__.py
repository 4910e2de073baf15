"""Replay: a log's measurements through the filter into a Record."""
