"""ArduPilot DataFlash logs (.bin): an own reader, whole files as columns at a time.

`formats` finds the messages and what they hold, `columns` gives them as arrays and as checked rows, `sensors` makes
streams of them, `flight` tables and the Log.
"""

from flownav.logs.dataflash.columns import DataFlash, read_columns
from flownav.logs.dataflash.flight import read_dataflash

__all__ = ["DataFlash", "read_columns", "read_dataflash"]
