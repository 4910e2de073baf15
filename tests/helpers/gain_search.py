"""The searches of gains (`tools/shape_gains.py`, `other_laws.py`) by name: `from gain_search import shape_gains`."""

from __future__ import annotations

import sys

from places import PROJECT

if str(PROJECT / "tools") not in sys.path:
    sys.path.insert(0, str(PROJECT / "tools"))

import flight_laws
import other_laws
import shape_gains

__all__ = ["flight_laws", "other_laws", "shape_gains"]
