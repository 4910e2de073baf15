"""The filter's stated accuracy: radius of uncertainty (figure 31), normalised errors, protection levels."""

import numpy as np

from flownav.core.measurement import COLUMNS, Array, Sensor
from flownav.core.record import POSITION_NED, PROTECTION_LEVELS, Record, mapping
from flownav.report.chart import Stack, sliding_mean, sliding_rms
from flownav.report.figures_innovation import SENSOR_TITLES, innovation_table
from flownav.report.panels import Panel, number
from flownav.report.series import Track, difference, moments, outages, readings, start_end_s, track
from flownav.scoring.consistency import MODEST_SQUARES, SCORED, chi_square_band
from flownav.scoring.recorded import consistency_in
from flownav.scoring.sensor_verdict import verdict

STD_POSITION = tuple(f"std_{name}" for name in POSITION_NED)
RADIUS_WINDOW_S = 5.0
NIS_WINDOW_S = 5.0
SMALLEST_NEES = 0.01  # values below are not drawn: the axis is logarithmic
SMALLEST_NIS = 0.01


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
            spread.append(("flown", "autopilot's input", flown and _radius(difference(flown, truth), axes)))
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
    rows = innovation_table(record).get("gps_position", {})
    wanted = [rows[name] for name in COLUMNS[Sensor.GPS_POSITION][:axes] if name in rows]
    if len(wanted) < axes or len({len(part["t_s"]) for part in wanted}) != 1 or "observation_variance" not in wanted[0]:
        return None
    variance = sum(np.asarray(part["observation_variance"], float) for part in wanted)
    return Track(wanted[0]["t_s"], 3.0 * np.sqrt(np.asarray(variance, float))[:, None])


def consistency(record: Record) -> list[Panel]:
    """Normalised estimation error squared of position and velocity over time; no panel where none was recorded."""
    nees = track(record, "consistency", ("nees",))
    if nees is None:
        return []
    span, (low, high) = start_end_s(record), chi_square_band(1)
    stack = Stack(("NEES",), row_height_px=190)
    shown = np.where(nees.value[:, 0] < SMALLEST_NEES, np.nan, nees.value[:, 0])
    stack.line(1, "estimate", "filter", nees.t_s, shown)
    for name, limit in (("95 % band", low), ("95 % band", high)):
        stack.line(1, "gate", name, np.array(span), np.full(2, limit))
    stack.line(1, "command", "expected", np.array(span), np.full(2, float(SCORED)))
    stack.log_axis(1)
    inside = 100.0 * float(np.mean((nees.value >= low) & (nees.value <= high)))
    caption = (
        f"Squared error of position and velocity in units of what the filter states, {SCORED} expected. Of a "
        f"consistent filter 95 % of the values lie between {low:.2f} and {high:.2f} over many flights; "
        f"here {inside:.0f} % do. Errors are correlated in time, so a single flight may stay outside for a while."
    )
    title = "Consistency with the truth"
    alt = f"{title}: NEES over time. {caption}"
    return [Panel("nees", title, caption, alt, stack.chart(span, moments(record)), wide=True)]


def normalised_innovations(record: Record) -> list[Panel]:
    """Innovation squared over its stated variance, its mean over a sliding window, a row a sensor; none without."""
    table = innovation_table(record)
    sensors = {name: found for name, parts in table.items() if (found := _squares(parts)) is not None}
    if not sensors:
        return []
    span = start_end_s(record)
    stack = Stack([f"{_sensor_title(name)}: {_judged(record, name)}" for name in sensors], row_height_px=92)
    for row, squares in enumerate(sensors.values(), 1):
        mean = np.maximum(sliding_mean(squares.t_s, squares.value[:, 0], NIS_WINDOW_S), SMALLEST_NIS)
        for limit in MODEST_SQUARES:
            stack.line(row, "gate", "2 and 1/2", np.array(span), np.full(2, limit))
        stack.line(row, "command", "as stated", np.array(span), np.ones(2))
        stack.line(row, "estimate", "mean NIS", squares.t_s, mean)
        stack.log_axis(row)
    caption = (
        f"Innovations squared over their stated variance (NIS), a mean over a sliding {NIS_WINDOW_S:.0f} s: 1 is a "
        "filter that knows its errors, above 2 it is too sure of itself, below 1/2 it is too careful. Above each axis: "
        "the mean of what was fused in flight, and its verdict."
    )
    title = "Are the innovations as large as stated?"
    alt = f"Mean normalised innovation squared of each sensor over time. {caption}"
    return [Panel("nis", title, caption, alt, stack.chart(span, moments(record), outages(record)), wide=True)]


def _sensor_title(name: str) -> str:
    return SENSOR_TITLES.get(name, name.replace("_", " "))


def _judged(record: Record, name: str) -> str:
    """A sensor's mean NIS and verdict in words, as the record scores it or, where it does not, by the same rules."""
    scores = mapping(mapping(record.manifest.get("scores")).get("consistency")) or consistency_in(record)
    scored = mapping(scores.get(name))
    if not scored:
        return "not judged: none fused in flight"
    mean, refused = float(scored.get("nis_per_dof") or 0.0), float(scored.get("refused") or 0.0)
    return f"{number(mean, 2)}, {verdict(mean, white=bool(scored.get('white')), refused=refused)}"


def _squares(parts: dict[str, dict[str, Array]]) -> Track | None:
    """Normalised squares of all components of a sensor in order of time, tested ones, rejected ones among them."""
    t_s, squares = [], []
    for part in parts.values():
        if "innovation" not in part or "innovation_variance" not in part:
            continue
        good = np.isfinite(part["innovation"]) & (part["innovation_variance"] > 0.0)
        t_s.append(part["t_s"][good])
        squares.append(part["innovation"][good] ** 2 / part["innovation_variance"][good])
    if not sum(map(len, t_s)):
        return None
    times = np.concatenate(t_s)
    order = np.argsort(times, kind="stable")
    return Track(times[order], np.concatenate(squares)[order][:, None])


def protection(record: Record) -> list[Panel]:
    """Protection levels over time, horizontal and vertical; no panel where none were recorded."""
    levels = track(record, "estimate", PROTECTION_LEVELS)
    if levels is None or not np.isfinite(levels.value).any():
        return []
    truth, estimate = track(record, "truth", POSITION_NED), track(record, "estimate", POSITION_NED)
    stack = Stack(("horizontal (m)", "vertical (m)"), row_height_px=190)
    for row in (1, 2):
        stack.line(row, "command", "protection level", levels.t_s, levels.value[:, row - 1])
    if truth is not None and estimate is not None:
        apart = difference(estimate, truth)
        stack.line(1, "estimate", "error", apart.t_s, np.hypot(*apart.value[:, :2].T))
        stack.line(2, "estimate", "error", apart.t_s, np.abs(apart.value[:, 2]))
    stack.from_zero()
    middle = np.nanmedian(levels.value, axis=0)
    title = "Protection levels"
    caption = (
        "How far off the position may be although nothing is noticed: the filter's own error, or what a flow of wrong "
        "sign, axes, scale or age, a range, GPS or heading that is off, or an accelerometer that lies may have done so "
        f"far. In the median {middle[0]:.2f} m horizontally, {middle[1]:.2f} m vertically."
    )
    figure = stack.chart(start_end_s(record), moments(record), outages(record))
    return [Panel("protection", title, caption, f"{title} over time. {caption}", figure, wide=True)]
