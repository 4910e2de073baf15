"""Signs of what the flow sensor saw: too little texture, a blur near the ground, noise, and silence."""

import numpy as np

from flownav.core.measurement import Array, Sensor
from flownav.studies.explain.case import Case, FlowSeen
from flownav.studies.explain.flow_signs import NO_FLOW, NO_RATES, found_lag
from flownav.studies.explain.sign import Found, Lack, Picture, Sign, Trace, Window, nothing
from flownav.studies.explain.signals import Flags, at, running_mean, running_median, spread, stretches

BIN_S = 1.0
BLIND_S, SILENT_S = 4.0, 1.2
DARK_QUALITY, DARK_SHARE = 60.0, 0.45  # of 255; of the log's usual quality
ZERO_SHARE, EXPECTED_RAD_S = 0.25, 0.06
LOW_M, NOISE_RATIO, LEAST_LOW_S = 0.45, 3.0, 1.5
LOWS_M = (0.15, 0.2, 0.25, 0.3, 0.35, 0.4, LOW_M)  # where the blur may end

MOTION_SHARE = 0.5  # chosen: a PMW3901 jumps by a third to half of the flow, ten indoor flights
NOISY_RAD_S, NOISE_S, NOISE_WINDOW_S, LEAST_NOISY = 0.3, 3.0, 2.0, 30  # six times what a good sensor has
FUSED_EVERY_S = 0.05  # filters average readings that come faster


def blind_bins(case: Case, flow: FlowSeen) -> tuple[Array, Flags]:
    """Second by second in flight: whether the flow saw little; starts (n,), flags (n,).

    Little: readings of no data, a quality far below the log's usual one, or exact zeros while the vehicle moves.
    """
    usual = float(np.percentile(flow.quality[flow.lifted], 90)) if flow.lifted.any() else 255.0
    poor = (flow.quality <= 0.0) | (flow.quality < min(DARK_QUALITY, DARK_SHARE * usual))
    zero = (flow.value[:, :2] == 0.0).all(axis=1) & (flow.quality > 0.0) & _moving(case, flow)
    starts = np.arange(case.flight_s[0], case.flight_s[1], BIN_S)
    row = np.clip(((flow.t_s - case.flight_s[0]) / BIN_S).astype(int), -1, len(starts))
    inside = (row >= 0) & (row < len(starts)) & flow.lifted
    count = np.bincount(row[inside], minlength=len(starts))[: len(starts)]
    share = {
        name: np.bincount(row[inside], flags[inside].astype(float), len(starts))[: len(starts)] / np.maximum(count, 1)
        for name, flags in (("poor", poor), ("zero", zero))
    }
    return starts, (count > 0) & ((share["poor"] > 0.5) | (share["zero"] > ZERO_SHARE))


def _moving(case: Case, flow: FlowSeen) -> Flags:
    """Where the vehicle turns or goes so fast that its flow cannot be nothing."""
    moving = np.zeros(len(flow.t_s), bool)
    if case.rates is not None:
        lag = found_lag(case) or 0.05
        moving |= (np.abs(at(case.rates[0], case.rates[1][:, :2], flow.t_s - lag)) > EXPECTED_RAD_S).any(axis=1)
    velocity = case.level_speed
    if velocity is not None:
        far = np.where(np.isfinite(flow.range_m), flow.range_m, 2.0)
        moving |= np.interp(flow.t_s, *velocity) / np.maximum(far, 0.2) > 4.0 * EXPECTED_RAD_S
    return moving


def texture(case: Case) -> Found:
    """Too little to see: low quality, no data, or no motion reported where there is some."""
    if case.flow is None:
        return NO_FLOW
    flow = case.flow
    starts, blind = blind_bins(case, flow)
    low = _low(case, starts)
    if low.any() and (blind & low).sum() > 0.7 * blind.sum():
        blind = blind & ~low  # near the ground alone: that is the focus
    window = _window(starts, blind, case.flight_s)
    quality = (
        float(np.median(flow.quality[(flow.t_s >= window[0]) & (flow.t_s <= window[1])])) if blind.any() else 255.0
    )
    picture = Picture("quality (0 to 255)", (Trace("flow", "quality", flow.t_s, flow.quality, dots=True),))
    seconds = float(np.count_nonzero(blind)) * BIN_S
    return Sign(seconds / BLIND_S, window, {"seconds": seconds, "quality": quality}, (picture,))


def _low(case: Case, starts: Array) -> Flags:
    if case.range_height is None:
        return np.zeros(len(starts), bool)
    return np.asarray(np.interp(starts + 0.5 * BIN_S, *case.range_height) < case.ground_range_m + LOW_M)


def _window(starts: Array, flags: Flags, otherwise: Window) -> Window:
    rows = np.flatnonzero(flags)
    return (float(starts[rows[0]]), float(starts[rows[-1]] + BIN_S)) if len(rows) else otherwise


def focus(case: Case) -> Found:
    """Blurred near the ground: flow that is noise below some height and sound above it."""
    if case.flow is None:
        return NO_FLOW
    if case.ranges is None:
        return Lack("no range to know how near the ground the flow was taken")
    flow = case.flow
    good = flow.lifted & (flow.quality > 0.0) & np.isfinite(flow.range_m)
    above = flow.range_m - case.ground_range_m
    if case.rates is None or good.sum() < 50:
        return NO_RATES
    lag = found_lag(case) or 0.05
    left = flow.value[:, :2] - at(case.rates[0], case.rates[1][:, :2], flow.t_s - lag)
    second = _second(left)
    period = float(np.median(np.diff(flow.t_s)))
    lows = [rows for rows in (good & (above < e) for e in LOWS_M) if rows.sum() * period > LEAST_LOW_S]
    high = good & (above > 1.3 * LOW_M)
    if not lows or high.sum() * period < LEAST_LOW_S:
        return Lack("not long enough both near the ground and above it")
    noise = max(_noise(second[rows]) for rows in lows)
    lively = max(_noise(second[high]), 0.03)
    edge_m = _edge(above[good], np.abs(second[good]).max(axis=1), lively)
    ratio = noise / lively
    near = good & (above < edge_m)
    rows = stretches(near)
    window = (float(flow.t_s[rows[0][0]]), float(flow.t_s[rows[-1][1]])) if rows else case.flight_s
    figures: dict[str, float | str] = {"height_m": edge_m, "noise_rad_s": noise, "above_rad_s": lively}
    picture = Picture("noise of the flow (rad/s)", (
        Trace("flow", "below the height", flow.t_s[near], np.abs(second[near]).max(axis=1), dots=True),
        Trace("gps", "above it", flow.t_s[good & ~near], np.abs(second[good & ~near]).max(axis=1), dots=True),
    ), "From reading to reading, the turning taken off.")  # fmt: skip
    return Sign(ratio / NOISE_RATIO, window, figures, (picture,))


def _noise(second: Array) -> float:
    return max(spread(column) for column in second.T)


def _edge(above_m: Array, noise: Array, usual: float) -> float:
    """The height from which on the noise is usual again [m]."""
    edges = np.arange(0.0, 1.2, 0.05)
    for low in edges:
        inside = (above_m >= low) & (above_m < low + 0.05)
        if inside.sum() > 20 and np.median(noise[inside]) < 2.0 * usual:
            return float(low)
    return LOW_M


def noise(case: Case) -> Found:
    """Readings that the sensor calls good and that jump from one to the next as no vehicle does."""
    if case.flow is None:
        return NO_FLOW
    flow = case.flow
    good = flow.lifted & (flow.quality > 0.0) & np.isfinite(flow.value[:, :2]).all(axis=1)
    good[good] = _news(flow.value[good, :2])
    t_s, seen = flow.t_s[good], flow.value[good, :2]
    if len(t_s) < LEAST_NOISY:
        return Lack("too few flow readings in flight")
    period = float(np.median(np.diff(t_s)))
    left = [seen]  # brisk turning jumps in what is seen, a gyro's noise in what is left without the turning
    if case.rates is not None:
        lag = found_lag(case) or 0.05
        left.append(seen - at(case.rates[0], case.rates[1][:, :2], t_s - lag))
    count = max(round(NOISE_WINDOW_S / period), LEAST_NOISY // 2)
    averaged = float(np.sqrt(min(period / FUSED_EVERY_S, 1.0)))
    jumps = averaged * np.min([_running_noise(_second(of), count) for of in left], axis=0)
    rows = max(round(NOISE_S / period), 1)
    level = float(np.sort(jumps)[-rows]) if len(jumps) > rows else 0.0
    noise_stated = case.own_settings.flow_noise_rad_s
    limit = max(NOISY_RAD_S, noise_stated or 0.0)
    noisy = np.flatnonzero(jumps > 0.6 * max(level, limit))
    size = float(np.median(jumps[noisy])) if len(noisy) >= rows else level
    if len(noisy):  # counters jump by a share of what they count
        limit = max(limit, MOTION_SHARE * float(np.median(_motion(seen, jumps / averaged, count)[noisy])))
    window = (float(t_s[noisy[0]]), float(t_s[noisy[-1]])) if len(noisy) else case.flight_s
    figures: dict[str, float | str] = {
        "noise_rad_s": size, "usual_rad_s": float(np.median(jumps)),
        "told": "no value" if noise_stated is None else f"{noise_stated:.2f} rad/s",
    }  # fmt: skip
    picture = Picture("flow (rad/s)", (
        Trace("flow", "flow x", t_s, seen[:, 0], dots=True), Trace("gps", "flow y", t_s, seen[:, 1], dots=True),
    ), "A vehicle's motion makes lines of the dots.")  # fmt: skip
    return Sign(size / limit, window, figures, (picture,))


def _motion(seen: Array, jumps: Array, count: int) -> Array:
    """The flow (n,) about the axis that has more of it, rms over `count` rows, without its jumps."""
    power = running_mean(seen**2, count).max(axis=1)
    return np.asarray(np.sqrt(np.maximum(power - jumps**2, 0.0)))


def _news(values: Array) -> Flags:
    """Which rows (n,) of columns are no repetition of the one before: a link may send a reading twice."""
    return np.concatenate([[True], (np.diff(values, axis=0) != 0.0).any(axis=1)])[: len(values)]


def _second(values: Array) -> Array:
    """Second differences of columns (n, 2), scaled to have the size of white noise itself."""
    second = np.zeros_like(values)
    second[1:-1] = (values[2:] - 2.0 * values[1:-1] + values[:-2]) / np.sqrt(6.0)
    return second


def _running_noise(second: Array, count: int) -> Array:
    """The spread of second differences (n, 2) about each row, of the noisier column (n,)."""
    return np.asarray(np.max([1.4826 * running_median(np.abs(column), count) for column in second.T], axis=0))


def silent(case: Case) -> Found:
    """No readings at all while the other sensors go on."""
    if case.flow is None:
        return NO_FLOW
    t_s = case.flow.t_s
    inside = (t_s >= case.flight_s[0]) & (t_s <= case.flight_s[1])
    times = np.concatenate([[case.flight_s[0]], t_s[inside], [case.flight_s[1]]])
    steps = np.diff(times)
    usual = float(np.median(np.diff(t_s)))
    row = int(np.argmax(steps))
    gap, begin = float(steps[row]), float(times[row])
    others = [
        s for sensor, s in case.log.streams.items() if sensor not in (Sensor.FLOW_RATE, Sensor.LANDED) and len(s) > 10
    ]
    going = [s for s in others if np.count_nonzero((s.t_s > begin + 0.2) & (s.t_s < begin + gap - 0.2)) > 0]
    if gap < 10.0 * usual or not going:
        return nothing(case.flight_s)
    picture = Picture("flow x (rad/s)", (Trace("flow", "flow x", t_s, case.flow.value[:, 0], dots=True),))
    return Sign(gap / (2.0 * SILENT_S), (begin, begin + gap), {"seconds": gap}, (picture,))
