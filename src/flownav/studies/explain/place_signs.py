"""Signs of GPS and of the compass: glitches, lag, a heading that is off, a field that the motors push."""

import numpy as np

from flownav.core.frames import turned_level
from flownav.core.measurement import Array, Sensor
from flownav.logs.log import integrated
from flownav.studies.explain.case import Case
from flownav.studies.explain.sign import Found, Lack, Picture, Sign, Trace, nothing
from flownav.studies.explain.signals import at, running_mean, stretches

GLITCH_M, WALK_M, UNBROKEN_S = 4.0, 9.5, 2.0  # in one step; within half a minute; no gap for so long
LAG_S, UNSTATED_LAG_S, USUAL_LAG_S = 0.42, 0.50, 0.22  # a receiver's own velocity lags by 0.2 s beside its delay
TURN_RAD, SIGNIFICANT = 0.45, 4.0
LAST_S, LEAST_ROWS = 5.0, 8  # before it lands; logs end soon after
SETTLED_S, OFF_S, OFF_TURNS = 1.5, 4.0, 1.2  # a field that was off for this long, by this multiple of TURN_RAD
PUSHED_SHARE, REST_S, LEAST_REST_ROWS = 0.30, 12.0, 15
LEAST_LEVEL_GAUSS, QUIET_RAD_S, TURNED_COUNTS = 0.05, 0.1, 0.6


def glitch(case: Case) -> Found:
    """Positions that jump or walk away from where the receiver's own velocity leads, and come back."""
    place, speed = case.stream(Sensor.GPS_POSITION), case.stream(Sensor.GPS_VELOCITY)
    if place is None or len(place) < 30:
        return Lack("no GPS")
    if speed is None or not np.isfinite(speed.value[:, :2]).all(axis=1).any():
        return Lack("no GPS velocity to hold the positions against")
    known = np.isfinite(speed.value[:, :2]).all(axis=1)
    moved = at(speed.t_s[known], speed.value[known, :2], place.t_s)
    steps = np.diff(place.t_s)
    path = integrated(moved, steps)
    apart = place.value[:, :2] - path
    broken = np.where((steps < UNBROKEN_S)[:, None], 0.0, np.diff(apart, axis=0))  # across a gap nothing is known
    apart = apart - np.vstack([np.zeros(2), np.cumsum(broken, axis=0)])
    slow = np.column_stack([_slow(place.t_s, column) for column in apart.T])
    away = np.hypot(*(apart - slow).T)
    level = np.hypot(*np.diff(apart, axis=0).T)
    jump = float(level.max(initial=0.0))
    walk = float(away.max())
    away_rows = stretches(away > 0.5 * max(jump, min(walk, WALK_M), GLITCH_M))
    inside = [(a, b) for a, b in away_rows if b > a]
    window = (float(place.t_s[inside[0][0]]), float(place.t_s[inside[-1][1]])) if inside else case.log.span_s
    strength = max(jump / GLITCH_M, walk / WALK_M)
    jumped = jump / GLITCH_M >= 0.8 * strength
    figures: dict[str, float | str] = {
        "how": "jumped" if jumped else "walked",
        "metres": jump if jumped else walk,
        "seconds": window[1] - window[0] if inside else 0.0,
    }
    picture = Picture(
        "GPS position from its own velocity (m)",
        (
            Trace("gps", "north", place.t_s, apart[:, 0] - np.median(apart[:, 0])),
            Trace("flow", "east", place.t_s, apart[:, 1] - np.median(apart[:, 1])),
        ),
        "A sound receiver's two agree to a metre or two.",
    )
    return Sign(strength, window, figures, (picture,))


def _slow(t_s: Array, values: Array) -> Array:
    """The median over a minute: what a receiver's slow errors make."""
    count = max(3, round(60.0 / max(float(np.median(np.diff(t_s))), 1e-2)))
    half = count // 2
    rows = np.arange(0, len(values), max(1, half // 8))
    middle = [np.median(values[max(0, row - half) : row + half + 1]) for row in rows]
    return np.interp(np.arange(len(values)), rows, middle)


def lag(case: Case) -> Found:
    """Finds fixes that are older than the autopilot's parameter states."""
    if case.stream(Sensor.GPS_VELOCITY) is None:
        return Lack("no GPS velocity")
    tie = case.heading_tie
    if tie is None:
        return Lack("too little motion, or no inertial readings, to know how old the fixes are")
    stated_s = case.own_settings.gps_delay_s
    over = tie.lag_s - (stated_s if stated_s is not None else USUAL_LAG_S)
    strength = max(over, 0.0) / (LAG_S if stated_s is not None else UNSTATED_LAG_S)
    figures: dict[str, float | str] = {
        "lag_ms": 1e3 * tie.lag_s,
        "told": "no value" if stated_s is None else f"{1e3 * stated_s:.0f} ms",
    }
    if case.gps_velocity is None or case.inertial_velocity is None:
        return nothing(case.flight_s, strength)
    t_s, gps = case.gps_velocity
    picture = Picture(
        "north velocity (m/s)",
        (
            Trace("gps", "GPS", t_s, gps[:, 0]),
            *(
                [
                    Trace(
                        "estimate",
                        "the navigator",
                        case.base.estimate_rows.t_s,
                        case.base.estimate_rows.vel_ned_m_s[:, 0],
                    )
                ]
                if case.base
                else []
            ),
        ),
        "Fixes that come late follow behind.",
    )
    return Sign(strength * min(1.0, tie.significance / (2.0 * SIGNIFICANT)), case.flight_s, figures, (picture,))


# -- heading -------------------------------------------------------------------------------------------------------
def compass(case: Case) -> Found:
    """A heading that is off: the vehicle accelerates elsewhere than GPS sees it go."""
    if case.attitude is None:
        return Lack("no attitude")
    went = _went_off(case)
    if went is not None and went.strength > 1.0:
        return went
    if case.gps_velocity is None:
        return went if went is not None else Lack("no GPS velocity to hold the heading against")
    heading, tie = case.heading_tie, case.flow_tie
    if heading is None and tie is None:
        return Lack("too little motion to hold the heading against GPS")
    turns = []
    if heading is not None:
        turns.append((heading.turn_rad, heading.significance))
    if tie is not None and case.flow_fit is not None and not tie.mirrored:
        from flownav.studies.explain.flow_signs import turned

        angle, mirrored, sure = turned(case)
        if sure > 0.0 and not mirrored:
            turns.append((tie.turn_rad - angle, min(tie.significance, sure)))
    if not turns:
        return Lack("too little motion to hold the heading against GPS")
    weights = np.array([sure for _, sure in turns])
    mean = complex(np.sum(weights * np.exp(1j * np.array([turn for turn, _ in turns]))) / weights.sum())
    turn, agree = float(np.angle(mean)), abs(mean)
    strength = abs(turn) / TURN_RAD * agree**2 * min(1.0, float(weights.max()) / (2.0 * SIGNIFICANT))
    degrees = float(np.degrees(turn))
    figures: dict[str, float | str] = {
        "turn_deg": degrees, "said": f"The heading is {degrees:.0f} degrees off the course by GPS", "in_flight": 0.0
    }  # fmt: skip
    return Sign(strength, case.flight_s, figures, _course_picture(case))


def _went_off(case: Case) -> Sign | None:
    """The field, made level by the attitude, points elsewhere than it did after take-off, for long."""
    field = case.stream(Sensor.MAG)
    if field is None or case.attitude is None:
        return None
    aloft = case.lifted(field.t_s) & (field.t_s > case.flight_s[0] + SETTLED_S) & (field.t_s < case.flight_s[1])
    first = aloft & (field.t_s < case.flight_s[0] + SETTLED_S + OFF_S)
    if first.sum() < LEAST_REST_ROWS or aloft.sum() < 3 * first.sum():
        return None
    t_s, value = field.t_s[aloft], field.value[aloft]
    r = case.rotation(t_s)
    north = r[0] * value[:, 0] + r[1] * value[:, 1] + r[2] * value[:, 2]
    east = r[3] * value[:, 0] + r[4] * value[:, 1] + r[5] * value[:, 2]
    start = int(first.sum())
    points = (north + 1j * east) / complex(np.median(north[:start]), np.median(east[:start]))
    rows = max(round(OFF_S / max(float(np.median(np.diff(t_s))), 1e-3)), 3)
    held = running_mean(np.column_stack([points.real, points.imag]), rows)
    turn = np.arctan2(held[:, 1], held[:, 0])
    worst = np.argsort(np.abs(turn))[-rows]
    strength = float(np.abs(turn[worst])) / (OFF_TURNS * TURN_RAD)
    off = np.flatnonzero(np.abs(turn) > 0.6 * np.abs(turn[worst]))
    picture = Picture("direction of the field (deg)", (
        Trace("gps", "field, level by the attitude", t_s, np.degrees(np.angle(points)), dots=True),
    ), "Over the ground the field points one way; here it leaves the heading that it agreed with.")  # fmt: skip
    window = (float(t_s[off[0]]), float(t_s[off[-1]])) if len(off) else case.flight_s
    degrees = float(np.degrees(turn[worst]))
    sentence = f"In flight the compass went off by {abs(degrees):.0f} degrees from the heading that it agreed with"
    return Sign(strength, window, {"turn_deg": degrees, "said": sentence, "in_flight": 1.0}, (picture,))


def _course_picture(case: Case) -> tuple[Picture, ...]:
    if case.gps_velocity is None or case.flow_velocity is None:
        return ()
    t_s, body = case.flow_velocity
    r = case.rotation(t_s)
    count = max(1, round(0.8 / max(float(np.median(np.diff(t_s))), 1e-3)))
    north = running_mean((r[0] * body[:, 0] + r[1] * body[:, 1])[:, None], count)[:, 0]
    return (
        Picture(
            "north velocity (m/s)",
            (
                Trace("gps", "GPS", case.gps_velocity[0], case.gps_velocity[1][:, 0]),
                Trace("flow", "flow, turned by the attitude's heading", t_s, north),
            ),
            "With the right heading the two lie on each other.",
        ),
    )


def motors(case: Case) -> Found:
    """A field that changes when the motors run: at take-off, against the heading by the gyro."""
    field = case.stream(Sensor.MAG)
    if field is None:
        return Lack("no magnetometer")
    if case.rates is None or case.attitude is None:
        return Lack("no inertial readings to turn the field with")
    start, end = case.flight_s
    t_s, quiet = field.t_s, np.abs(at(*case.rates, field.t_s)).max(axis=1) < QUIET_RAD_S
    rest = (t_s < start - 0.3) & (t_s > start - REST_S) & quiet
    up = (t_s > start + 1.5) & (t_s < start + REST_S)
    if rest.sum() < LEAST_REST_ROWS or up.sum() < LEAST_REST_ROWS:
        return Lack("no stretch on the ground before take-off to compare the field with")
    level = _level_field(case, t_s, field.value)
    before, after = np.median(level[rest], axis=0), np.median(level[up], axis=0)
    horizontal = float(np.hypot(*before[:2]))
    if horizontal < LEAST_LEVEL_GAUSS:
        return Lack("no level field to compare")
    found = [_changed(before, after, horizontal)]
    last, stands = (t_s > end - LAST_S) & (t_s < end - 1.0), (t_s > end + 0.3) & (t_s < end + REST_S) & quiet
    if min(last.sum(), stands.sum()) >= LEAST_ROWS:  # what the motors push is gone when they stop
        found.append(_changed(np.median(level[stands], axis=0), np.median(level[last], axis=0), horizontal))
    share, change = min(found)
    turn = float(np.degrees(np.angle(complex(*after[:2]) / complex(*before[:2]))))
    back = float(case.attitude_yaw(start))
    away = after - before
    added = turned_level(float(away[0]), float(away[1]), float(np.cos(back)), -float(np.sin(back)))
    figures: dict[str, float | str] = {
        "share": 100.0 * share,
        "mgauss": 1e3 * change,
        "turn_deg": turn,
        "x_mgauss": 1e3 * float(added[0]),
        "y_mgauss": 1e3 * float(added[1]),
        "z_mgauss": 1e3 * float(after[2] - before[2]),
    }
    strength_gauss = running_mean(np.linalg.norm(field.value, axis=1)[:, None], 5)[:, 0]
    picture = Picture(
        "field strength (gauss)",
        (Trace("gps", "field", field.t_s, strength_gauss),),
        "Calm motors change it by less than a tenth.",
    )
    return Sign(share / PUSHED_SHARE, (start, case.flight_s[1]), figures, (picture,))


def _changed(before: Array, after: Array, horizontal: float) -> tuple[float, float]:
    """By how much a level field (3,) changed: as a share of its level part, in size, whatever the heading is, or
    turned; and in gauss.
    """
    change = float(np.linalg.norm(after - before))
    plain = float(np.hypot(np.hypot(*after[:2]) - np.hypot(*before[:2]), after[2] - before[2]))
    return max(plain, TURNED_COUNTS * change) / max(horizontal, 0.15), change


def _level_field(case: Case, t_s: Array, field: Array) -> Array:
    """The field (n, 3) made level by the attitude's roll and pitch, and turned by the gyro's heading."""
    assert case.rates is not None
    r = case.rotation(t_s)
    earth = np.column_stack(
        [
            r[0] * field[:, 0] + r[1] * field[:, 1] + r[2] * field[:, 2],
            r[3] * field[:, 0] + r[4] * field[:, 1] + r[5] * field[:, 2],
            r[6] * field[:, 0] + r[7] * field[:, 1] + r[8] * field[:, 2],
        ]
    )
    by_attitude = np.unwrap(np.arctan2(r[3], r[0]))
    times, rates = case.rates
    by_gyro = integrated(rates[:, 2], np.minimum(np.diff(times), 0.2))
    rest = times < case.flight_s[0] - 0.3
    drift = np.polyfit(times[rest], by_gyro[rest], 1)[0] if rest.sum() > 50 else 0.0
    gyro_yaw = by_gyro - drift * (times - times[0])
    start = case.flight_s[0]
    gyro_yaw = gyro_yaw - np.interp(start, times, gyro_yaw) + case.attitude_yaw(start)
    back = np.interp(t_s, times, gyro_yaw) - by_attitude
    north, east = turned_level(earth[:, 0], earth[:, 1], np.cos(back), np.sin(back))
    return np.column_stack([north, east, earth[:, 2]])
