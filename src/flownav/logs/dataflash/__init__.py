"""ArduPilot DataFlash logs (.bin): an own reader, whole files as columns at a time.

`scan` finds the messages, `formats` what they hold, `columns` gives them as arrays; `rows` checks them, `sensors` and
`reference` make streams and tables of them, `flight` the Log.
"""

from flownav.logs.dataflash.columns import DataFlash, read_columns
from flownav.logs.dataflash.flight import read_dataflash

__all__ = ["DataFlash", "read_columns", "read_dataflash"]
