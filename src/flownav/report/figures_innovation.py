"""Innovations in the band that they were expected in, and states beyond position and velocity in theirs."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import COLUMNS, Array, Sensor
from flownav.core.record import Record, mapping
from flownav.report.chart import Stack
from flownav.report.panels import Panel
from flownav.report.series import moments, outages, start_end_s, track
from flownav.scoring.phases import phases_of

INNOVATION_NUMBERS = ("t_s", "observation_variance", "innovation", "innovation_variance", "test_ratio", "fused")
ON_GROUND = ("ground", "landed")  # phases in which nobody navigates
SMALLEST_RATIO = 0.01  # test ratios below are not drawn: the axis is logarithmic
AXIS_TITLES = {
    "pos_n_m": "x, north (m)",
    "pos_e_m": "y, east (m)",
    "pos_d_m": "z, down (m)",
    "vel_n_m_s": "north (m/s)",
    "vel_e_m_s": "east (m/s)",
    "vel_d_m_s": "down (m/s)",
    "vel_u_m_s": "u (m/s)",
    "vel_v_m_s": "v (m/s)",
    "vel_w_m_s": "w (m/s)",
}
SENSOR_TITLES = {
    "gps_position": "GPS position",
    "gps_velocity": "GPS velocity",
    "flow_rate": "Flow",
    "flow_velocity": "Flow velocity",
    "range": "Rangefinder",
    "imu": "IMU",
    "attitude": "Attitude",
    "baro": "Barometer",
    "mag": "Magnetometer",
    "pose": "External position",
    "yaw": "External heading",
    "pad": "Pad fix",
    "landed": "Landed signal (at rest)",
}


def innovations(record: Record) -> list[Panel]:
    """A panel for each sensor offered to the filter: innovations in their 3-sigma band, test ratio and gate."""
    sensors = innovation_table(record)
    if not sensors:
        return [Panel("innovations", "Innovations", absent="The record holds no innovations.")]
    most_rows_first = sorted(sensors.items(), key=lambda item: -len(item[1]))  # panels of a pair are equally high
    shown = [_innovation_panel(record, name, components) for name, components in most_rows_first]
    return shown + [_untested(record, name) for name in _offered(record) if name not in sensors]


def _offered(record: Record) -> list[str]:
    """Sensors that were offered to the filter to correct it, by the record's streams and by what was rejected."""
    names = [sensor.name.lower() for sensor in Sensor if sensor is not Sensor.IMU]
    scores = mapping(record.manifest.get("scores"))
    counts = {**mapping(scores.get("readings")), **mapping(scores.get("rejected"))}
    return [name for name in names if name in counts]


def _untested(record: Record, name: str) -> Panel:
    """The panel of a sensor of which no reading was held against the prediction, with the reasons."""
    title = f"Innovations: {SENSOR_TITLES.get(name, name.replace('_', ' '))}"
    scores = mapping(record.manifest.get("scores"))
    counted = mapping(mapping(mapping(scores.get("readings")).get(name)).get("rejected"))
    counted = counted or mapping(mapping(scores.get("rejected")).get(name))
    why = "; ".join(f"{str(reason).replace('_', ' ')} {count:,}" for reason, count in counted.items())
    words = "None of its readings was held against the prediction" + (f": {why}." if why else ".")
    return Panel(f"innovation-{name}", title, absent=words)


def innovation_table(record: Record) -> dict[str, dict[str, dict[str, Array]]]:
    """The innovation table as sensor name -> component name -> columns."""
    table = record.tables.get("innovation", {})
    if not len(table.get("t_s", ())) or "innovation" not in table or "sensor" not in table:
        return {}
    count = len(table["t_s"])
    sensor_of, component_of = np.asarray(table["sensor"]), np.asarray(table.get("component", np.zeros(count)))
    numeric = [name for name in INNOVATION_NUMBERS if name in table]
    found: dict[str, dict[str, dict[str, Array]]] = {}
    for sensor in dict.fromkeys(sensor_of.tolist()):
        rows = np.flatnonzero(sensor_of == sensor)
        name = _sensor_name(sensor)
        components = component_of[rows]
        for component in dict.fromkeys(components.tolist()):
            mine = rows[components == component]
            part = {column: np.asarray(table[column][mine], float) for column in numeric}
            found.setdefault(name, {})[_component_name(name, component)] = part
    return found


def _sensor_name(value: object) -> str:
    return Sensor(int(value)).name.lower() if isinstance(value, (int, float)) else str(value).lower()


def _component_name(sensor: str, value: object) -> str:
    names = COLUMNS[Sensor[sensor.upper()]] if sensor.upper() in Sensor.__members__ else ()
    if isinstance(value, (int, float)) and 0 <= int(value) < len(names):
        return names[int(value)]
    return str(value)


def axis_title(name: str) -> str:
    """A column name as an axis has it: "pos_n_m" is "x, north (m)", "gyro_x_rad_s" is "gyro x (rad/s)"."""
    if name in AXIS_TITLES:
        return AXIS_TITLES[name]
    for suffix, unit in (
        ("_rad_s", "rad/s"),
        ("_m_s2", "m/s²"),
        ("_m_s", "m/s"),
        ("_gauss", "gauss"),
        ("_rad", "rad"),
        ("_m", "m"),
    ):
        if name.endswith(suffix):
            return f"{name.removesuffix(suffix).replace('_', ' ')} ({unit})"
    return name.replace("_", " ")


def _innovation_panel(record: Record, sensor: str, components: dict[str, dict[str, Array]]) -> Panel:
    title = f"Innovations: {SENSOR_TITLES.get(sensor, sensor.replace('_', ' '))}"
    ratios = [part["test_ratio"] for part in components.values() if "test_ratio" in part]
    tested = any(np.any(ratio >= SMALLEST_RATIO) for ratio in ratios)
    stack = Stack([axis_title(name) for name in components] + ["test ratio"] * tested, row_height_px=118)
    colour = "flow" if sensor.startswith("flow") else "gps" if sensor.startswith("gps") else "estimate"
    gate_row, offered, refused = len(components) + 1, 0, 0
    for row, part in enumerate(components.values(), 1):
        t_s = part["t_s"]
        fused = part.get("fused", np.ones(len(t_s))) > 0.5
        offered, refused = offered + len(t_s), refused + int((~fused).sum())
        if "innovation_variance" in part:
            expected = 3.0 * np.sqrt(np.maximum(part["innovation_variance"], 0.0))
            stack.band(row, "±3\N{GREEK SMALL LETTER SIGMA} expected", t_s, expected)
            stack.within(row, _reach(part["innovation"], expected[in_flight(record, t_s)]))
        stack.dots(row, colour, "fused", t_s[fused], part["innovation"][fused])
        stack.crosses(row, "alert", "not fused", t_s[~fused], part["innovation"][~fused])
        if tested and "test_ratio" in part:
            ratio = np.where(part["test_ratio"] < SMALLEST_RATIO, np.nan, part["test_ratio"])
            stack.dots(gate_row, colour, "fused", t_s[fused], ratio[fused])
            stack.crosses(gate_row, "alert", "not fused", t_s[~fused], ratio[~fused])
    span = start_end_s(record)
    if tested:
        stack.line(gate_row, "gate", "gate", np.array(span), np.ones(2))
        stack.log_axis(gate_row)
    figure = stack.chart(span, moments(record), outages(record))
    caption = f"{offered} values offered, {refused} not fused."
    if tested:
        caption += f" A test ratio above 1 is outside the gate; those below {SMALLEST_RATIO} are not drawn."
    elif ratios:
        caption += f" All test ratios are below {SMALLEST_RATIO}, and so inside the gate."
    return Panel(f"innovation-{sensor}", title, caption, f"{title}: {caption}", figure)


def in_flight(record: Record, t_s: Array) -> NDArray[np.bool_]:
    """Which instants (n,) are in no phase on the ground; all of a record that has no other."""
    found = phases_of(record)
    flown = np.ones(len(t_s), bool)
    for phase in found if any(phase.name not in ON_GROUND for phase in found) else []:
        if phase.name in ON_GROUND:
            flown &= (t_s < phase.t0) | (t_s > phase.t1)
    return flown


def _reach(innovation: Array, expected: Array) -> float:
    """Half the height of an axis that shows every innovation, and 90 % of the band in flight: at rest and next to the
    ground it may be a hundred times as wide.
    """
    known = expected[np.isfinite(expected)]
    shown = [np.abs(innovation[np.isfinite(innovation)]), np.quantile(known, [0.9]) if len(known) else known]
    return 1.1 * float(np.max(np.concatenate(shown), initial=1e-6))


LEAST_CHANGE = 1e-9  # a state and a deviation that change by less were not estimated


class Group(NamedTuple):
    """A panel of states: its key, title and caption, and for each row a title and (state, name, role) drawn on it."""

    key: str
    title: str
    caption: str
    rows: tuple[tuple[str, float, tuple[tuple[str, str, str], ...]], ...]


FAST_PART = "fast part"  # of the receiver's error, drawn without a band
DEGREES = 57.29577951308232
EARTH = (("north", "n"), ("east", "e"), ("down", "d"))


def _one(title: str, state: str, name: str, scale: float = 1.0) -> tuple[str, float, tuple[tuple[str, str, str], ...]]:
    """A row with one state on it."""
    return title, scale, ((state, name, "estimate"),)


GROUPS = (
    Group(
        "gyro-bias",
        "Gyro bias",
        "The filter's estimate of the gyro's bias, and three of its standard deviations.",
        tuple(_one(f"{a} (°/s)", f"gyro_bias_{a}_rad_s", "bias", DEGREES) for a in "xyz"),
    ),
    Group(
        "accel-bias",
        "Accelerometer bias",
        "The same of the accelerometer.",
        tuple(_one(f"{a} (m/s²)", f"accel_bias_{a}_m_s2", "bias") for a in "xyz"),
    ),
    Group(
        "gps-errors",
        "Error of the GPS position",
        "The filter's estimate of the receiver's error: a part that wanders for minutes and one for seconds.",
        tuple(
            (f"{title} (m)", 1.0, ((f"gps_slow_{a}_m", "slow part", "estimate"), (f"gps_fast_{a}_m", FAST_PART, "gps")))
            for title, a in EARTH
        ),
    ),
    Group(
        "gps-velocity-errors",
        "Error of the GPS velocity",
        "The filter's estimate of the receiver's velocity error.",
        tuple(_one(f"{title} (m/s)", f"gps_velocity_{a}_m_s", "error") for title, a in EARTH),
    ),
    Group(
        "other-states",
        "Other states of the filter",
        "Those that this flight's sensors let it estimate, each with three of its standard deviations.",
        (
            _one("ground, down (m)", "ground_d_m", "ground"),
            _one("barometer (m)", "baro_m", "offset"),
            _one("flow scale (m/m)", "flow_scale", "error of scale"),
            *(_one(f"compass, {title} (°)", f"compass_{a}_rad", "error", DEGREES)
              for title, a in (("sine", "sin"), ("cosine", "cos"))),
            *(_one(f"attitude sensor, {a} (°)", f"ins_{a}_rad", "error", DEGREES)
              for a in ("roll", "pitch", "heading")),
            _one("age of velocity (s)", "velocity_lag_s", "age"),
            *(_one(f"pad, {title} (m)", f"pad_{a}_m", "pad") for title, a in EARTH),
        ),
    ),
)  # fmt: skip


def inner_states(record: Record) -> list[Panel]:
    """A panel for each group of which the filter estimated a state; none where the record holds no such states."""
    return [panel for group in GROUPS if (panel := _panel(record, group)) is not None]


def _panel(record: Record, group: Group) -> Panel | None:
    rows = [
        (title, scale, found)
        for title, scale, drawn in group.rows
        if (found := [one for one in drawn if _estimated(record, one[0])])
    ]
    if not rows:
        return None
    stack = Stack([title for title, _, _ in rows], row_height_px=84 if len(rows) > 3 else 110)
    for row, (_, scale, found) in enumerate(rows, 1):
        for column, name, role in found:
            state = track(record, "states", (column, f"std_{column}"))
            if state is None:
                continue
            value, sigma = scale * state.value.T
            if name != FAST_PART:
                stack.band(row, "±3\N{GREEK SMALL LETTER SIGMA} stated", state.t_s, 3.0 * sigma, value)
            stack.line(row, role, name, state.t_s, value)
    chart = stack.chart(start_end_s(record), moments(record), outages(record))
    alt = f"{group.title} over time: {', '.join(title for title, _, _ in rows)}."
    return Panel(group.key, group.title, group.caption, alt, chart)


def _estimated(record: Record, column: str) -> bool:
    """Whether a state has a standard deviation above zero and either of them changes."""
    state = track(record, "states", (column, f"std_{column}"))
    if state is None:
        return False
    known = state.value[np.isfinite(state.value).all(axis=1)]
    return bool(len(known) > 1 and known[:, 1].max() > 0.0 and np.ptp(known, axis=0).max() > LEAST_CHANGE)
