"""Filters from other libraries, or written to be read: how a user's own filter fits into flownav, scored next to
ours.
"""
