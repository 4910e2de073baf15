"""A DataFlash log's content besides its sensors: parameters, modes, EKF3's source set, messages, clipping."""

from collections.abc import Iterator

import numpy as np

from flownav.core.frames import quaternion_from_euler
from flownav.core.measurement import Array
from flownav.core.record import POSITION_NED, QUATERNION, Table
from flownav.core.text import plain
from flownav.logs.dataflash.columns import DataFlash, Field, message_rows, text
from flownav.logs.happened import (
    CLIPPING,
    MODE,
    PARAMETER,
    SOURCE_SET,
    VIBRATION,
    Happened,
    changes,
    copter_mode,
    in_time,
    messages,
)

SETTLED_S = 1.0  # the first ones are written in one go; one that comes this long after the last was set in flight
SOURCES_BY_EVENT = {85: 1.0, 86: 2.0, 87: 3.0}  # AP_Logger's LogEvent: EK3_SOURCES_SET_TO_PRIMARY and on
CLIPPING_S = 1.0
VIBRATION_M_S2 = 5.0


def parameters(log: DataFlash) -> dict[str, float]:
    """The vehicle's parameters by name, as last written."""
    _, names, values = _written(log)
    return dict(zip(names, map(float, values), strict=True))


def happened(log: DataFlash, start_s: float) -> tuple[Happened, ...]:
    """All events of the log, in order of time; start_s: the vehicle's time at time 0 of the log."""
    rows = [*_set(log), *_modes(log), *_source_sets(log), *_clipping(log), *_vibration(log), *_messages(log)]
    return in_time(row._replace(t_s=float(row.t_s) - start_s) for row in rows)


def _written(log: DataFlash) -> tuple[Array, list[str], Array]:
    """Every PARM message: when [s], name, value; nothing where the log has none that can be read."""
    known = log.formats.get("PARM")
    nothing: tuple[Array, list[str], Array] = np.zeros(0), [], np.zeros(0)
    if known is None or not {"Name", "Value"} <= set(known.labels) or known.code("Name") not in "nNZ":
        return nothing
    if known.code("Value") in "anNZ":
        return nothing
    timed = "TimeUS" in known.numbers
    table = log.table("PARM", ["Name", "Value", *(["TimeUS"] if timed else [])])
    t_s = 1e-6 * table["TimeUS"].astype(float) if timed else np.zeros(len(table["Value"]))
    return t_s, text(table["Name"]), np.asarray(table["Value"], float)


def _set(log: DataFlash) -> Iterator[Happened]:
    """Parameters that were set to something else after the log had begun."""
    t_s, names, values = _written(log)
    before: dict[str, float] = {}
    late = np.concatenate([[False], np.cumsum(np.diff(t_s) > SETTLED_S) > 0]) if len(t_s) else np.zeros(0, bool)
    for at_s, name, value, after in zip(t_s, names, values, late, strict=True):
        if after and np.isfinite(value) and before.get(name, value) != value:
            yield Happened(float(at_s), PARAMETER, name, float(value))
        before[name] = float(value)


def _modes(log: DataFlash) -> Iterator[Happened]:
    for label in ("ModeNum", "Mode"):
        rows = message_rows(log, "MODE", (Field(label, 0, 255),))
        if rows is not None:
            yield from changes(MODE, rows.t_s, rows.columns[label], copter_mode)
            return


def _source_sets(log: DataFlash) -> Iterator[Happened]:
    """By event where a switch or a script changed the set, else by EKF3's own word."""
    events = message_rows(log, "EV", (Field("Id", 0, 255),))
    if events is not None and np.isin(events.columns["Id"], list(SOURCES_BY_EVENT)).any():
        for at_s, event in zip(events.t_s.tolist(), events.columns["Id"].tolist(), strict=True):
            if event in SOURCES_BY_EVENT:
                yield Happened(at_s, SOURCE_SET, f"source set {SOURCES_BY_EVENT[event]:.0f}", SOURCES_BY_EVENT[event])
        return
    sets_stated = message_rows(log, "XKFS", (Field("SS", 0, 2),))
    if sets_stated is not None:
        yield from changes(SOURCE_SET, sets_stated.t_s, sets_stated.columns["SS"] + 1.0, "source set {}".format)


def _clipping(log: DataFlash) -> Iterator[Happened]:
    """Of one IMU's counter, or of three in a message of old."""
    rows = message_rows(log, "VIBE", tuple(Field(f"Clip{k}", 0, 1e9, required=False) for k in ("", "0", "1", "2")))
    if rows is None or not rows.columns:
        return
    count = np.maximum.accumulate(np.max(np.column_stack(list(rows.columns.values())), axis=1))
    yield from changes(CLIPPING, rows.t_s, count, least_s=CLIPPING_S)


def _vibration(log: DataFlash) -> Iterator[Happened]:
    """The largest of the three axes, of the first IMU."""
    rows = message_rows(
        log, "VIBE", (*(Field(f"Vibe{axis}", 0, 1e4) for axis in "XYZ"), Field("IMU", 0, 9, required=False))
    )
    if rows is None:
        return
    first = rows.columns["IMU"] == 0.0 if "IMU" in rows.columns else np.ones(len(rows.t_s), bool)
    level = np.max([rows.columns[f"Vibe{axis}"][first] for axis in "XYZ"], axis=0)
    steps = VIBRATION_M_S2 * np.floor(level / VIBRATION_M_S2)
    yield from changes(VIBRATION, rows.t_s[first], steps, "{} m/s2".format, CLIPPING_S)


def _messages(log: DataFlash) -> Iterator[Happened]:
    known = log.formats.get("MSG")
    if known is None or "Message" not in known.labels or "TimeUS" not in known.numbers:
        return iter(())
    if known.code("Message") not in "nNZ":
        return iter(())
    table = log.table("MSG", ["TimeUS", "Message"])
    return messages(zip((1e-6 * table["TimeUS"]).tolist(), map(plain, text(table["Message"])), strict=True))


PLACE_M, SAME_STEP_S = 1e6, 1e-3
ANGLES = (Field("DesRoll", -181, 181), Field("DesPitch", -91, 91), Field("DesYaw", -361, 361))
BATTERY = (Field("Volt", 0, 1000), Field("Curr", -1000, 10_000, required=False))


def setpoints(log: DataFlash, start_s: float) -> tuple[Table, ...]:
    """The position (PSCN, PSCE and PSCD, PSC in old logs; about EKF3's origin) and the attitude (ATT) that ArduPilot
    asked for; a log without them, or whose rows cannot be used, has none.
    """
    place, rows = _asked_place(log), message_rows(log, "ATT", ANGLES)
    found = [] if place is None else [place | {"t_s": place["t_s"] - start_s}]
    if rows is not None and len(rows.t_s):
        angles = np.radians(rows.matrix("DesRoll", "DesPitch", "DesYaw"))
        attitude = quaternion_from_euler(*angles.T)
        found.append({"t_s": rows.t_s - start_s, **dict(zip(QUATERNION, map(np.asarray, attitude), strict=True))})
    return tuple(found)


def _asked_place(log: DataFlash) -> Table | None:
    """By the vehicle's time; NaN along an axis of which the log has no message, or none yet."""
    axes = [(f"PSC{axis}", f"TP{axis}") for axis in "NED"]
    if not log.count("PSCN"):
        axes = [("PSC", "TPX"), ("PSC", "TPY"), ("", "")]
    each = [message_rows(log, name, (Field(label, -PLACE_M, PLACE_M),)) if name else None for name, label in axes]
    if each[0] is None or not len(each[0].t_s):
        return None
    t_s, asked = each[0].t_s, []
    for rows, (_, label) in zip(each, axes, strict=True):
        if rows is None or not len(rows.t_s):
            asked.append(np.full(len(t_s), np.nan))
            continue
        at = np.searchsorted(rows.t_s, t_s + SAME_STEP_S) - 1  # the three are written one after the other
        asked.append(np.where(at < 0, np.nan, rows.columns[label][np.maximum(at, 0)]))
    return {"t_s": t_s, **dict(zip(POSITION_NED, asked, strict=True))}


def battery(log: DataFlash, start_s: float) -> Table | None:
    """The battery's voltage and, where it is measured, its current (BAT, CURR in old logs); None without any."""
    for name in ("BAT", "CURR"):
        several = name in log.formats and log.formats[name].instance is not None
        rows = message_rows(log, name, BATTERY, instance=0 if several else None)
        if rows is not None and len(rows.t_s) and (rows.columns["Volt"] > 0.0).any():
            current = {"current_a": rows.columns["Curr"]} if "Curr" in rows.columns else {}
            return {"t_s": rows.t_s - start_s, "voltage_v": rows.columns["Volt"], **current}
    return None
