"""The search of gains (`tools/shape_gains.py`), importable by name: `from gain_search import shape_gains`."""

from __future__ import annotations

import sys

from places import PROJECT

if str(PROJECT / "tools") not in sys.path:
    sys.path.insert(0, str(PROJECT / "tools"))

import shape_gains

__all__ = ["shape_gains"]
