"""Filters that were not made here, or are made to be read: how one's own stands in flownav, scored beside ours."""
