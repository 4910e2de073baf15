"""Signs of the inertial unit and of the landing flag: vibration, a lying accelerometer, gaps, landed in the air."""

import numpy as np

from flownav.core.frames import GRAVITY_M_S2, to_body
from flownav.core.measurement import Array, Sensor
from flownav.studies.explain.case import Case
from flownav.studies.explain.sign import Found, Lack, Picture, Sign, Trace, Window, nothing
from flownav.studies.explain.signals import Flags, at, gap_near, running_mean, stretches

NO_IMU = Lack("no inertial readings of 20 Hz or more")
LEAST_IMU_HZ = 20.0
STATED_SHAKEN_M_S2 = 30.0  # by ArduPilot's manual (Measuring vibration); a log's own readings may be filtered before
SHAKEN_M_S2, CLIPPED_SHARE, CLIPPED_COUNT, LEAST_EQUAL = 9.0, 0.004, 100.0, 6
LYING_LEVEL_M_S2, LYING_DOWN_M_S2, LYING_S = 0.8, 0.60, 4.0
SPEED_AGE_S = 1.0  # a speed that is older is not known
USUAL_SPREADS = 4.0  # of a gusty flight's own middle
CHANCE = 3.0  # standard errors
DRAG_UNKNOWN = 0.7  # of the drag by the speed over ground, since wind and manoeuvres are not known
GAP_S, GAP_STEPS = 0.25, 8.0
LANDED_S, ALOFT_M = 1.5, 0.25


def _imu(case: Case) -> tuple[Array, Array] | None:
    imu = case.stream(Sensor.IMU)
    if imu is None or len(imu) < 100 or (len(imu) - 1) / (imu.t_s[-1] - imu.t_s[0]) < LEAST_IMU_HZ:
        return None
    return imu.t_s, imu.value


def vibration(case: Case) -> Found:
    """Shaking and clipping of the accelerometer."""
    imu = _imu(case)
    if imu is None:
        return NO_IMU
    t_s, value = imu
    force = value[:, 3:]
    quick = np.zeros_like(force)
    quick[1:-1] = (force[2:] - 2.0 * force[1:-1] + force[:-2]) / np.sqrt(6.0)
    count = max(3, round(2.0 / float(np.median(np.diff(t_s)))))
    shaking = np.sqrt(running_mean(quick**2, count)).max(axis=1)
    inside = case.lifted(t_s)
    level = float(np.quantile(shaking[inside], 0.9)) if inside.any() else 0.0
    limit = np.abs(force).max(axis=0)
    at_limit = (np.abs(force) >= limit - 1e-6).sum(axis=0)
    railed = float(at_limit[at_limit >= LEAST_EQUAL].sum() / len(force))
    railed = railed if float(limit.max()) > 3.0 * GRAVITY_M_S2 else 0.0
    clips = (case.clipped or 0.0) / CLIPPED_COUNT
    strong = inside & (shaking > 0.6 * level)
    rows = np.flatnonzero(strong)
    window = (float(t_s[rows[0]]), float(t_s[rows[-1]])) if len(rows) else case.flight_s
    figures: dict[str, float | str] = {
        "level_m_s2": max(level, case.shaken_m_s2),
        "clipped": 100.0 * railed,
        "counted": case.clipped if case.clipped is not None else 0.0,
        "clips": _clips(railed, case.clipped or 0.0),
    }
    picture = Picture(
        "accelerometer (m/s\N{SUPERSCRIPT TWO})",
        (Trace("estimate", "z", t_s, force[:, 2]), Trace("gps", "x", t_s, force[:, 0])),
        "In hover z is near -9.8 and x near 0.",
    )
    shaken = max(level / SHAKEN_M_S2, case.shaken_m_s2 / STATED_SHAKEN_M_S2)
    return Sign(max(shaken, railed / CLIPPED_SHARE, clips), window, figures, (picture,))


def _clips(railed: float, counted: float) -> str:
    """The words about clipping; "" where there is none."""
    phrases = [f"in {100.0 * railed:.1f} % of its readings"] if railed >= 5e-4 else []
    phrases += [f"{counted:.0f} times by the vehicle's count"] if counted > 0.0 else []
    return f", and clips: {' and '.join(phrases)}" if phrases else ""


def lying(case: Case) -> Found:
    """A specific force that the motion does not bear out, without the shaking that would explain it."""
    imu = _imu(case)
    if imu is None:
        return NO_IMU
    if case.attitude is None:
        return Lack("no attitude")
    t_s, value = imu
    count = max(5, round(LYING_S / float(np.median(np.diff(t_s)))))
    mean = running_mean(value[:, 3:], count)
    half = 0.5 * LYING_S
    aloft = case.lifted(t_s - half) & case.lifted(t_s + half)
    aloft &= (t_s > case.flight_s[0] + half) & (t_s < case.flight_s[1] - half)
    if aloft.sum() < count:
        return Lack("not long enough in flight")
    drag = _drag(case, t_s, mean[:, :2], aloft, count)
    level = np.hypot(*(mean[:, :2] - drag).T)
    most_drag = float(np.quantile(np.hypot(*(drag[aloft] - np.median(drag[aloft], axis=0)).T), 0.99))
    chance = CHANCE * _shaking(value[aloft, 3:]) / count**0.5  # of a mean of `count` shaken readings
    usual = max(
        LYING_LEVEL_M_S2 + chance, USUAL_SPREADS * float(np.quantile(level[aloft], 0.5)), DRAG_UNKNOWN * most_drag
    )
    down, known = _down_off(case, t_s, value[:, 3:], count)
    ratio = np.maximum(level / usual, np.where(known, np.abs(down) / (LYING_DOWN_M_S2 + chance), 0.0))
    ratio = np.where(aloft, ratio, 0.0)
    whole = float(np.hypot(*(np.median(mean[aloft, :2], axis=0))))  # a rotor pulls along z alone
    strength = max(float(ratio.max()), whole / (2.5 * LYING_LEVEL_M_S2))
    rows = np.flatnonzero(ratio > 0.6 * max(float(ratio.max()), 0.5))
    window = (float(t_s[rows[0]]), float(t_s[rows[-1]])) if len(rows) else case.flight_s
    worst = int(np.argmax(ratio))
    figures: dict[str, float | str] = {
        "level_m_s2": max(float(level[worst]), whole if strength > float(ratio.max()) else 0.0),
        "down_m_s2": float(abs(down[worst])),
    }
    picture = Picture(
        "mean force over four seconds (m/s\N{SUPERSCRIPT TWO})",
        (
            Trace("estimate", "x", t_s, mean[:, 0]),
            Trace("gps", "y", t_s, mean[:, 1]),
            Trace("flow", "z, and gravity", t_s, mean[:, 2] + GRAVITY_M_S2),
        ),
        "Over seconds a vehicle that goes nowhere feels gravity alone.",
    )
    return Sign(strength, window, figures, (picture,))


def _shaking(force: Array) -> float:
    """The white noise of specific force (n, 3), of the axis with most [m/s2]."""
    second = (force[2:] - 2.0 * force[1:-1] + force[:-2]) / np.sqrt(6.0)
    return float(np.sqrt(np.mean(second**2, axis=0)).max()) if len(second) else 0.0


def _drag(case: Case, t_s: Array, level: Array, aloft: Flags, count: int) -> Array:
    """The level force that the air makes: by the speed over ground and its square, and constant with the wind.

    Least squares, axis by axis; the median where no speed is known, and the force itself where it is not known then.
    """
    middle = np.array(np.broadcast_to(np.median(level[aloft], axis=0), level.shape))
    speed = _body_speed(case, t_s, count)
    if speed is None:
        return middle
    unknown = ~np.isfinite(speed).all(axis=1)
    aloft = aloft & ~unknown
    speed = np.nan_to_num(speed)
    for axis in range(2):
        v = speed[:, axis]
        design = np.column_stack([np.ones(len(v)), v, v * np.abs(v)])
        fitted = np.linalg.lstsq(design[aloft], level[aloft, axis], rcond=None)[0]
        if fitted[1] + fitted[2] * float(np.abs(v[aloft]).max()) <= 0.0:  # drag is against the motion
            middle[:, axis] = design @ fitted
    middle[unknown] = level[unknown]
    return middle


def _body_speed(case: Case, t_s: Array, count: int) -> Array | None:
    """Speed along body x and y (n, 2), averaged as the force is: by GPS where a reading is near, else by flow, else
    NaN.
    """
    body = np.full((len(t_s), 2), np.nan)
    for found in (case.flow_velocity, _gps_in_body(case)):
        if found is not None:
            body = np.where((gap_near(found[0], t_s) <= SPEED_AGE_S)[:, None], at(*found, t_s), body)
    known = np.isfinite(body).all(axis=1)
    if not known.any():
        return None
    filled = at(t_s[known], body[known], t_s)
    return np.where(known[:, None], running_mean(filled, count), np.nan)


def _gps_in_body(case: Case) -> tuple[Array, Array] | None:
    if case.gps_velocity is None:
        return None
    t_s, v = case.gps_velocity
    return t_s, np.column_stack(to_body(case.rotation(t_s), *v.T)[:2])


def _down_off(case: Case, t_s: Array, force: Array, count: int) -> tuple[Array, Flags]:
    """The mean force along earth's down less what the height's second difference asks for, and where that is known.

    The second difference over T is the acceleration under a triangle of half-width T, as a box of width T taken twice.
    """
    heights = [case.range_height] if case.range_height is not None else []
    heights += [of for name, of in case.other_heights.items() if name == "barometer"]
    r = case.rotation(t_s)
    along = r[6] * force[:, 0] + r[7] * force[:, 1] + r[8] * force[:, 2] + GRAVITY_M_S2
    down = running_mean(running_mean(along[:, None], count), count)[:, 0]
    if not heights:
        return down, np.zeros(len(t_s), bool)
    found = []
    for times, height in heights:
        smooth = np.interp(t_s, times, height)
        step = LYING_S
        bend = np.interp(t_s + step, t_s, smooth) - 2.0 * smooth + np.interp(t_s - step, t_s, smooth)
        found.append(down + bend / step**2)
    least = np.argmin(np.abs(np.array(found)), axis=0)
    return np.array(found)[least, np.arange(len(t_s))], np.ones(len(t_s), bool)


def gap(case: Case) -> Found:
    """Inertial readings stop while the other sensors go on."""
    imu = _imu(case)
    if imu is None:
        return NO_IMU
    t_s = imu[0]
    steps = np.diff(t_s)
    usual = float(np.median(steps))
    inside = (t_s[:-1] > case.log.span_s[0] + 1.0) & (t_s[:-1] < case.log.span_s[1] - 1.0)
    long = inside & (steps > max(GAP_STEPS * usual, 0.1))
    lone = [row for row in np.flatnonzero(long) if _others_go_on(case, float(t_s[row]), float(t_s[row + 1]))]
    if not lone:
        return nothing(case.flight_s)
    worst = max(lone, key=lambda row: steps[row])
    window = (float(t_s[lone[0]]), float(t_s[lone[-1] + 1]))
    figures: dict[str, float | str] = {
        "seconds": float(steps[worst]),
        "count": float(len(lone)),
        "at_s": float(t_s[worst]),
    }
    picture = Picture("since the last reading (s)", (Trace("estimate", "inertial readings", t_s[1:], steps),))
    return Sign(min(float(steps[worst]) / GAP_S, 5.0), window, figures, (picture,))


def _others_go_on(case: Case, begin: float, end: float) -> bool:
    """Whether most fast sensors sent readings meanwhile: else the log has a hole, and shows nothing."""
    fast = [
        s
        for sensor, s in case.log.streams.items()
        if sensor not in (Sensor.IMU, Sensor.LANDED, Sensor.ATTITUDE)
        and len(s) > 20
        and np.median(np.diff(s.t_s)) < 0.6 * (end - begin)
    ]
    sampled = [np.count_nonzero((s.t_s > begin) & (s.t_s < end)) > 0 for s in fast]
    return bool(sampled and sum(sampled) > 0.5 * len(sampled))


def landed(case: Case) -> Found:
    """Finds a landed state that is reported while the vehicle is in the air."""
    flag = case.stream(Sensor.LANDED)
    if flag is None:
        return Lack("nothing reports when it had landed")
    flying = flag.t_s[flag.value[:, 0] < 0.5]
    if not len(flying):
        return Lack("the flag never reports flight")
    grid = np.arange(max(case.flight_s[0], flying[0]), min(case.flight_s[1], flying[-1]), 0.05)
    if len(grid) < 20:
        return nothing(case.flight_s)
    row = np.clip(np.searchsorted(flag.t_s, grid, side="right") - 1, 0, len(flag) - 1)
    landed_stated = flag.value[row, 0] > 0.5
    if case.range_height is not None:
        aloft = np.interp(grid, *case.range_height) > case.ground_range_m + ALOFT_M
        aloft &= case.lifted(grid)
    elif case.other_heights:
        aloft = np.min([np.interp(grid, *of) for of in case.other_heights.values()], axis=0) > 1.0
    else:
        return Lack("no height to hold the landing flag against")
    wrong = landed_stated & aloft
    long = [(a, b) for a, b in stretches(wrong) if grid[b] - grid[a] > 0.5]
    seconds = sum(float(grid[b] - grid[a]) for a, b in long)
    window: Window = (float(grid[long[0][0]]), float(grid[long[-1][1]])) if long else case.flight_s
    picture = Picture(
        "height (m), and 1 where the landed state is reported",
        (
            Trace(
                "truth",
                "height",
                grid,
                np.interp(grid, *case.range_height) if case.range_height else np.zeros(len(grid)),
            ),
            Trace("flow", "reported as landed", grid, landed_stated.astype(float)),
        ),
    )
    return Sign(seconds / LANDED_S, window, {"seconds": seconds}, (picture,))
