"""The reference of a record's tables: every table and column of `flownav.core.record.TABLES`, with its unit."""

from __future__ import annotations

from itertools import groupby

from units import unit_of

from flownav.core.measurement import COLUMNS, Sensor
from flownav.core.record import TABLES

INTRODUCTION = """# Tables of a record

A record (`.fnr`) is a zip of Parquet tables and one `manifest.json`; it opens in any language. In Python,
`flownav.load("flight.fnr").estimate["pos_n_m"]` is a column as a NumPy array. Every table has the column `t_s`, the
time in seconds. A record has the tables that its flight could fill, and a table may lack its last columns.

Positions (`pos_n_m`, `pos_e_m`, `pos_d_m`) are north, east and down of the local frame (NED), whose origin is the pad
of a simulated flight and the place of the first fix of a log. `vel_u_m_s`, `vel_v_m_s` and `vel_w_m_s` are along the
body's axes, forward, right and down (FRD); `vel_n_m_s`, `vel_e_m_s` and `vel_d_m_s` are along the earth's. The
quaternion `qw, qx, qy, qz` turns the body's axes into the earth's. `std_` before a name is one standard deviation of
it, as the filter states it.
"""
MEANINGS = {
    "truth": "The vehicle's true motion: from the simulation, or from motion capture.",
    "estimate": "The filter's estimate, with one standard deviation of each figure, and the protection levels: how far "
    "off the position may be if a sensor fails and nothing notices.",
    "consistency": "Where the truth is known: NEES, the squared error of position and velocity over the covariance "
    "that the filter states. Its mean is 6 where the filter knows its own errors.",
    "states": "The rest of the filter's estimate at the same instants: velocity along the earth's axes, standard "
    "deviations of the attitude, and every other state with its own.",
    "smoothed": "The estimate smoothed over the whole flight (`replay --smooth`).",
    "autopilot": "The estimate of another estimator, such as the autopilot's own.",
    "flown": "The estimate used by the simulated autopilot: carried from the horizon to the present, its position "
    "relative to where the pad is taken to be.",
    "command": "The commands to the vehicle: the reference and the controls.",
    "setpoint": "The set-points of a log's autopilot, in the frame of the estimate: position and attitude, "
    "each where there is one.",
    "battery": "The battery, as a log has it.",
    "innovation": "One row for each component of a measurement that was offered to the filter: what was observed, how "
    "far it lay from the prediction, whether it was fused, and the reason where it was not.",
    "events": "One row for each happening: its source, its kind, its detail in words, and a value.",
    "judging": "Data for scoring besides truth and estimate. Of a simulated flight: the ground's height, whether "
    "the vehicle goes around, whether the pad can be seen, whether this step counts, and whether the flow sensor sees. "
    "Of a replay: whether a warning stands.",
    "reference": "The external reference of a log (motion capture, a simulator), in the frame in which the log has it.",
    "reference_heading": "The heading of that reference, where the log has it apart.",
    "fed": "The input of the navigator, row by row, in its order. `flownav replay` of the record takes these rows.",
}
STREAMS = """## Measurement streams

A stream of readings is a table named after its sensor. Beside the columns below it has `quality` (0 to 255, where 0
is no data).

| table | columns | units |
|---|---|---|
"""


def page() -> str:
    """The page. KeyError where a table has no sentence in MEANINGS."""
    return "\n\n".join([INTRODUCTION.rstrip(), *(_section(name) for name in TABLES), _streams()]) + "\n"


def _section(name: str) -> str:
    """One table: what it is, and its columns, those of one unit that follow each other in one row."""
    rows = [
        f"| {', '.join(f'`{column}`' for column in columns)} | {unit} |"
        for unit, columns in groupby(TABLES[name], key=unit_of)
    ]
    return "\n".join([f"## {name}", "", MEANINGS[name], "", "| columns | unit |", "|---|---|", *rows])


def _streams() -> str:
    """The table of what each sensor reads."""
    rows = []
    for sensor in Sensor:
        units = list(dict.fromkeys(unit_of(column) or "1" for column in COLUMNS[sensor]))
        rows.append(
            f"| `{sensor.name.lower()}` | {', '.join(f'`{c}`' for c in COLUMNS[sensor])} | {', '.join(units)} |"
        )
    return STREAMS + "\n".join(rows)
