"""The navigator's machine code: its entries, what is left out of it, and the same code in this process."""

import ctypes
from functools import cache
from typing import Any

from flownav.core.compiling import portable
from flownav.export.onboard import targets
from flownav.export.onboard.interface import SYMBOLS
from flownav.navigation import onboard

MODULE = "flownav.navigation.onboard"
NOT_WRITTEN = ("write_estimate", "note_estimate", "note_prediction", "note_decay", "note_correction")
WITHOUT = {  # parts that may be left out, and the procedures that then do nothing
    "protection": ("mind_faults", "set_levels", "weigh", "hold_unlearnt", "sign_flow"),
    "pad": ("take_pad", "take_pose"),
    "course": ("find_heading", "note_flow_course", "check_compass"),
}
# called where they are used, so that their share of the stack is free afterwards
APART = ("begin_reading", "come_closer", "go_away", "hear", "take", "do_parts", "tell_now", "state_now")
UNITS = {"begin": "begin_unit", "take": "take_unit", "now": "tell_unit", "digest": "digest_unit"}


def entries(lag: bool) -> tuple[portable.Entry, ...]:
    """The library's functions; lag: with the flow sensor's dynamics as states."""
    units = UNITS | {"take": "take_unit_with_lag"} if lag else UNITS
    room = (onboard.ROOM, (0,) * len(onboard.ROOM))
    return tuple(
        portable.Entry(MODULE, unit, SYMBOLS[name], room if name == "take" else ()) for name, unit in units.items()
    )


def machine_code(processor: portable.Processor, lag: bool, without: tuple[str, ...] = ()) -> bytes:
    """An object file with the entries. without: parts of WITHOUT. NoProcessorError where LLVM knows no such."""
    out = (*NOT_WRITTEN, *(name for part in without for name in WITHOUT[part]))
    return portable.kept_code(entries(lag), processor, tuple(SYMBOLS.values()), out, APART)


@cache
def code_here(lag: bool) -> dict[str, Any]:
    """The functions in this process, by name: on addresses of memory, they return 0."""
    processor = targets.own_processor()
    loaded = portable.Loaded(machine_code(processor, lag), processor)
    counts = {entry.symbol: entry.unit.letters.count("p") for entry in entries(lag)}
    return {name: loaded.function(symbol, counts[symbol]) for name, symbol in SYMBOLS.items()} | {"code": loaded}


def addresses(*arrays: Any) -> list[ctypes.c_void_p]:
    """Where arrays lie."""
    return [ctypes.c_void_p(array.ctypes.data) for array in arrays]
