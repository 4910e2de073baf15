"""How good the filter says it is: radius of uncertainty (figure 31), innovations, error against GPS."""

from __future__ import annotations

from html import escape

import numpy as np

from flownav.measurement import COLUMNS, Sensor
from flownav.record import POSITION_NED, Record
from flownav.report.chart import Stack
from flownav.report.panels import Panel
from flownav.report.series import (
    Array,
    Track,
    delay_s,
    difference,
    moments,
    outages,
    readings,
    sliding_rms,
    start_end_s,
    track,
)

STD_POSITION = tuple(f"std_{name}" for name in POSITION_NED)
RADIUS_WINDOW_S = 5.0
INNOVATION_NUMBERS = ("t_s", "observation_variance", "innovation", "innovation_variance", "test_ratio", "fused")
SMALLEST_NEES = 0.01  # values below are not drawn: the axis is logarithmic
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
    "landed": "Skid switch (at rest)",
}


def radius_of_uncertainty(record: Record) -> Panel:
    """3-sigma radius of the position from GPS alone and from the filter, horizontal and in space (figure 31).

    With truth, the spread of the errors over a sliding window; without, what the filter and the GPS state.
    """
    key, title = "radius", "Reduction of the radius of uncertainty"
    truth, estimate = track(record, "truth", POSITION_NED), track(record, "estimate", POSITION_NED)
    stated, gps = track(record, "estimate", STD_POSITION), readings(record, Sensor.GPS_POSITION)
    if estimate is None or (truth is None and stated is None):
        return Panel(key, title, absent="The record holds neither a truth nor standard deviations of the position.")
    stack = Stack(("horizontal (m)", "in space (m)"), row_height_px=190)
    medians: dict[str, float] = {}
    for row, axes in ((1, 2), (2, 3)):
        spread: list[tuple[str, str, Track | None]] = []
        if truth is not None:
            spread.append(("gps", "GPS alone", gps and _radius(difference(gps, truth), axes)))
            spread.append(("estimate", "filter", _radius(difference(estimate, truth), axes)))
            flown = track(record, "flown", POSITION_NED)
            spread.append(("flown", "flown on", flown and _radius(difference(flown, truth), axes)))
        else:
            spread.append(("gps", "stated for GPS alone", _gps_stated(record, axes)))
        if stated is not None:
            role = "estimate" if truth is None else "command"
            spread.append((role, "stated by the filter", Track(stated.t_s, 3.0 * _norm(stated.value, axes))))
        for role, name, radius in spread:
            if radius is not None and len(radius.t_s):
                stack.line(row, role, name, radius.t_s, radius.value[:, 0])
                medians.setdefault(name, float(np.median(radius.value)))
    stack.from_zero()
    figure = stack.chart(start_end_s(record), moments(record), outages(record))
    caption = (
        f"Three times the root-mean-square error over a sliding {RADIUS_WINDOW_S:.0f} s. "
        if truth is not None
        else "Without truth: three times the standard deviation that each states. "
    )
    caption += "Horizontal, in the median: " + "; ".join(f"{name} {value:.2f} m" for name, value in medians.items())
    alt = "3-sigma radius of the position over time, horizontal above and in space below. " + caption
    return Panel(key, title, caption + ".", alt, figure, wide=True)


def _norm(value: Array, axes: int) -> Array:
    """Length of the first `axes` components of each row, shape (n, 1)."""
    return np.asarray(np.sqrt((value[:, :axes] ** 2).sum(axis=1, keepdims=True)))


def _radius(error: Track, axes: int) -> Track:
    squares = (error.value[:, :axes] ** 2).sum(axis=1)
    return Track(error.t_s, 3.0 * sliding_rms(error.t_s, squares, RADIUS_WINDOW_S)[:, None])


def _gps_stated(record: Record, axes: int) -> Track | None:
    rows = _innovations(record).get("gps_position", {})
    wanted = [rows[name] for name in COLUMNS[Sensor.GPS_POSITION][:axes] if name in rows]
    if len(wanted) < axes or len({len(part["t_s"]) for part in wanted}) != 1 or "observation_variance" not in wanted[0]:
        return None
    variance = sum(np.asarray(part["observation_variance"], float) for part in wanted)
    return Track(wanted[0]["t_s"], 3.0 * np.sqrt(np.asarray(variance, float))[:, None])


def innovations(record: Record) -> list[Panel]:
    """A panel for each sensor offered to the filter: innovations in their 3-sigma band, test ratio and gate."""
    sensors = _innovations(record)
    if not sensors:
        return [Panel("innovations", "Innovations", absent="The record holds no innovations.")]
    return [_innovation_panel(record, name, components) for name, components in sensors.items()]


def _innovations(record: Record) -> dict[str, dict[str, dict[str, Array]]]:
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
    for suffix, unit in (("_rad_s", "rad/s"), ("_m_s2", "m/s²"), ("_m_s", "m/s"), ("_gauss", "gauss"), ("_m", "m")):
        if name.endswith(suffix):
            return f"{name.removesuffix(suffix).replace('_', ' ')} ({unit})"
    return name.replace("_", " ")


def _innovation_panel(record: Record, sensor: str, components: dict[str, dict[str, Array]]) -> Panel:
    title = f"Innovations: {SENSOR_TITLES.get(sensor, sensor.replace('_', ' '))}"
    ratios = [part["test_ratio"] for part in components.values() if "test_ratio" in part]
    tested = any(np.any(ratio >= SMALLEST_RATIO) for ratio in ratios)
    stack = Stack([escape(axis_title(name)) for name in components] + ["test ratio"] * tested, row_height_px=118)
    colour = "flow" if sensor.startswith("flow") else "gps" if sensor.startswith("gps") else "estimate"
    gate_row, offered, refused = len(components) + 1, 0, 0
    for row, part in enumerate(components.values(), 1):
        t_s = part["t_s"]
        fused = part.get("fused", np.ones(len(t_s))) > 0.5
        offered, refused = offered + len(t_s), refused + int((~fused).sum())
        if "innovation_variance" in part:
            expected = 3.0 * np.sqrt(np.maximum(part["innovation_variance"], 0.0))
            stack.band(row, "±3\N{GREEK SMALL LETTER SIGMA} expected", t_s, expected)
            stack.within(row, _reach(part["innovation"], expected))
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


def _reach(innovation: Array, expected: Array) -> float:
    """Half the height of an axis that shows every innovation, and the band but for its rare spikes."""
    known = expected[np.isfinite(expected)]
    shown = [np.abs(innovation[np.isfinite(innovation)]), np.quantile(known, [0.98]) if len(known) else known]
    return 1.1 * float(np.max(np.concatenate(shown), initial=1e-6))


def consistency(record: Record) -> list[Panel]:
    """Normalised estimation error squared of position and velocity over time; no panel where none was recorded."""
    nees = track(record, "consistency", ("nees",))
    if nees is None:
        return []
    from flownav.scoring.consistency import SCORED, chi_square_band

    span, (low, high) = start_end_s(record), chi_square_band(1)
    stack = Stack(("NEES",), row_height_px=250)
    shown = np.where(nees.value[:, 0] < SMALLEST_NEES, np.nan, nees.value[:, 0])
    stack.line(1, "estimate", "filter", nees.t_s, shown)
    for name, limit in (("95 % of a flight's steps lie between", low), ("95 % of a flight's steps lie between", high)):
        stack.line(1, "gate", name, np.array(span), np.full(2, limit))
    stack.line(1, "command", "expected", np.array(span), np.full(2, float(SCORED)))
    stack.log_axis(1)
    inside = 100.0 * float(np.mean((nees.value >= low) & (nees.value <= high)))
    caption = (
        f"Squared error of position and velocity in units of what the filter states, {SCORED} expected. Of a "
        f"consistent filter 95 % of the values lie between {low:.2f} and {high:.2f} over many flights; "
        f"here {inside:.0f} % do. Errors last, so one flight strays."
    )
    title = "Consistency with the truth"
    return [Panel("nees", title, caption, f"{title}: NEES over time. {caption}", stack.chart(span, moments(record)))]


def error_against_gps(record: Record) -> Panel:
    """Horizontal distance from GPS of the estimate, smoothed or the autopilot's too, outages shaded; without truth."""
    key, title = "gps-distance", "Horizontal distance from GPS"
    gps, estimate = readings(record, Sensor.GPS_POSITION), track(record, "estimate", POSITION_NED)
    if gps is None or estimate is None:
        return Panel(key, title, absent=f"The record holds no {'GPS position' if gps is None else 'estimate'}.")
    stack = Stack(("distance (m)",), row_height_px=250)
    others = [(role, track(record, role, POSITION_NED)) for role in ("autopilot", "smoothed")]
    for role, source in (*others, ("estimate", estimate)):
        if source is not None:
            apart = difference(gps, source)
            distance = np.hypot(*apart.value[:, :2].T)
            stack.dots(1, role, f"{role}, each reading", apart.t_s, distance)
            stack.line(1, role, role, apart.t_s, sliding_rms(apart.t_s, distance**2, RADIUS_WINDOW_S))
    stack.from_zero()
    windows = outages(record)
    figure = stack.chart(start_end_s(record), moments(record), windows)
    caption = f"Against each GPS reading, {delay_s(record, 'gps_position'):.2f} s before it arrived (its delay). "
    caption += f"The lines are root mean squares over a sliding {RADIUS_WINDOW_S:.0f} s; GPS noise stays in them."
    if windows:
        caption += " Shaded: GPS was withheld; the scores leave out the distance at the start, the figure does not."
    return Panel(key, title, caption, f"{title} over time. {caption}", figure, wide=True)
