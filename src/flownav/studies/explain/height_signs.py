"""Signs of range, ground and barometer: out of reach, stuck, spikes, steps of the ground, wash."""

import numpy as np

from flownav.core.measurement import Array, Sensor
from flownav.logs.log import integrated
from flownav.studies.explain.aloft import GROUND_RANGE_M, LIFTED_M, without_echo
from flownav.studies.explain.autopilot_settings import BARO, RANGE
from flownav.studies.explain.case import Case
from flownav.studies.explain.sign import Found, Lack, Picture, Sign, Trace, Window, nothing
from flownav.studies.explain.signals import Flags, at, gap_near, high_pass, running_median, stretches

NO_RANGE = Lack("no range")
MISSING_S, NEAR_S, REACHED_SHARE, LEFT_SHARE = 3.0, 0.6, 0.8, 0.4
STUCK_S, MOVED_M, BROKEN_S, LEAST_REPEATS = 1.5, 0.25, 0.5, 8
FLAT_M, FLAT_STEP_S, FLAT_S = 0.06, 0.2, (3.0, 6.0, 12.0, 24.0)  # as near to one distance, for so long
APART_M = 3.0  # twice what counts as wash
FLAT_MOVED_M, ALONE = 0.9, 1.7  # by barometer and GPS; by one of them alone this factor more
FLAT_QUICK_S, QUICK_MOVED_M = 4.0, 0.15  # of the accelerometer's own height
JUMP_ROWS, JUMP_M, BY_JUMPS = 3, 0.4, (1.0, 1.6, 2.0)
SPIKE_M, SPIKE_SHARE, SPIKES = 0.22, 0.15, 0.035
STEP_M, STEP_S, HELD_S = 0.24, 0.35, 0.5
HARMLESS, FOLLOWED = 0.2, 0.5
WASH_M, SPOOL_S, BESIDE_S, LEAST_PRESSURES = 1.5, 1.0, 4.0, 12
NOT_THE_HEIGHT = 0.6  # of the harm where the barometer is not what holds the height


def reach(case: Case) -> Found:
    """Finds a flight without valid range above the height that it has reached or that is set as its limit."""
    if case.ranges is None:
        return NO_RANGE
    t_s, range_m = case.ranges
    grid = np.arange(*case.flight_s, 0.1)
    missing = (gap_near(t_s, grid) > NEAR_S) & case.lifted(grid)
    heights = [np.interp(grid, *of) for of in case.other_heights.values()]
    if not heights:
        return Lack("no other height to know how high it was without a range")
    height_m = np.median(heights, axis=0)
    reached = float(np.quantile(range_m, 0.995))
    limit = case.own_settings.range_high_m
    ceiling = min(reached, limit) if limit is not None else reached
    missing &= height_m > REACHED_SHARE * ceiling - 0.2
    missing &= np.interp(grid, t_s, range_m) > LEFT_SHARE * ceiling  # what ends near the ground was too near
    window = _window(grid, missing, case.flight_s)
    seconds = 0.1 * float(np.count_nonzero(missing))
    harm = _needs_range(case, grid[missing])
    figures: dict[str, float | str] = {"seconds": seconds, "ceiling_m": ceiling, "height_m": float(height_m.max())}
    picture = Picture(
        "height (m)",
        (
            Trace("truth", "range", t_s, range_m, dots=True),
            Trace("estimate", "other heights", grid, height_m),
        ),
        "Above its reach the rangefinder gives no reading.",
    )
    return Sign(harm * seconds / MISSING_S, window, figures, (picture,))


def _needs_range(case: Case, t_s: Array) -> float:
    """How much of the time without a range the vehicle needed it: no GPS then, or the range was its height."""
    if not len(t_s):
        return 0.0
    place = case.stream(Sensor.GPS_POSITION)
    without = np.ones(len(t_s), bool) if place is None else gap_near(place.t_s, t_s) > 1.0
    numbers = case.source_set_at(t_s)
    for one in case.own_settings.sets:
        mine = numbers == one.number
        without |= mine & (one.height == RANGE)
        without |= mine & one.flow & (not one.gps)
    return float(np.mean(without))


def stuck(case: Case) -> Found:
    """One distance repeated, or read whatever the height is, while the vehicle goes up or down."""
    stream = case.stream(Sensor.RANGE)
    if stream is None or len(stream) < 50:
        return NO_RANGE
    t_s, range_m = stream.t_s, stream.value[:, 0]
    same = np.concatenate([[False], (np.diff(range_m) == 0.0) & (np.diff(t_s) < BROKEN_S)])
    inside = (t_s >= case.flight_s[0]) & (t_s <= case.flight_s[1])
    floor = range_m <= float(np.quantile(range_m, 0.02)) + 0.02
    no_echo = ~without_echo(range_m)
    runs = [(a, b) for a, b in stretches(same & inside & no_echo & ~floor) if b - a >= LEAST_REPEATS] or [(0, 0)]
    lasts = np.array([t_s[b] - t_s[max(a - 1, 0)] for a, b in runs])
    longest = int(np.argmax(lasts))
    others = np.delete(lasts, longest)
    usual = float(others.max(initial=0.0))
    a, b = runs[longest]
    window = (float(t_s[max(a - 1, 0)]), float(t_s[b]))
    moved = _moved(case, window)
    if moved is None:
        return Lack("no other height to know whether it moved meanwhile")
    figures: dict[str, float | str] = {"seconds": float(lasts[longest]), "metres": moved, "range_m": float(range_m[b])}
    picture = Picture("range (m)", (Trace("truth", "range", t_s, range_m, dots=True), *_other_traces(case)))
    strength = min(float(lasts[longest]) / max(STUCK_S, 3.0 * usual), 5.0) * min(1.0, moved / MOVED_M)
    flat = _flat(case)
    if flat is not None and flat.strength > strength:
        strength, window = flat.strength, flat.window_s
        figures = flat.figures
    return Sign(strength, window, figures, (picture,))


def _flat(case: Case) -> Sign | None:
    """The stretch in which the range read the same within its noise while every other witness of height moved most.

    The others: barometer and GPS, and what is quick of the accelerometer's own height.
    """
    if case.range_height is None or case.inertial_velocity is None:
        return None
    heights = {name: of for name, of in case.other_heights.items() if name != "autopilot"}
    others = [of for name, of in heights.items() if name != "barometer" or _rose_with_it(case, of)]
    if not others:
        return None
    grid = np.arange(*case.flight_s, FLAT_STEP_S)
    known = gap_near(case.range_height[0], grid) < FLAT_STEP_S
    read_m = np.interp(grid, *case.range_height)
    mine = np.where(known & (read_m > case.ground_range_m + LIFTED_M), read_m, np.nan)  # the ground is flat
    rows = max(1, round(1.0 / FLAT_STEP_S))
    times, moving = case.inertial_velocity
    quick = high_pass(grid, at(times, moving[:, 2:], grid), FLAT_QUICK_S)
    needed = FLAT_MOVED_M * (1.0 if len(others) > 1 else ALONE)
    theirs = [running_median(np.interp(grid, *of), rows) / needed for of in others]
    theirs.append(np.cumsum(quick[:, 0]) * FLAT_STEP_S / QUICK_MOVED_M)
    found = [_flattest(grid, mine, theirs, round(lasts / FLAT_STEP_S)) for lasts in FLAT_S]
    return max((one for one in found if one is not None), key=lambda one: one.strength, default=None)


def _rose_with_it(case: Case, other: tuple[Array, Array]) -> bool:
    """Whether another height rose as the range did at take-off: a barometer in the wash shows no motion later on.

    True where the log does not begin on the ground.
    """
    assert case.range_height is not None
    t_s, height_m = case.range_height
    begin_s = case.flight_s[0] + SPOOL_S
    after = (t_s > begin_s) & (t_s < begin_s + BESIDE_S)
    if case.ground_range_m == 0.0 or np.count_nonzero(after) < LEAST_PRESSURES:
        return True
    apart_m = np.interp(t_s[after], *other) - (height_m[after] - case.ground_range_m)
    return bool(abs(float(np.median(apart_m))) < APART_M)


def _flattest(grid: Array, mine: Array, theirs: list[Array], count: int) -> Sign | None:
    """Of the windows of `count` rows in which the range is flat the one in which the others moved most."""
    if len(grid) <= count:
        return None
    span = np.ptp(np.lib.stride_tricks.sliding_window_view(mine, count), axis=1)
    moved = np.min([np.ptp(np.lib.stride_tricks.sliding_window_view(h, count), axis=1) for h in theirs], axis=0)
    moved = np.where(span < FLAT_M, moved, 0.0)  # not known: not flat
    row = int(np.argmax(moved))
    if moved[row] <= 0.0:
        return None
    held_m = float(np.median(mine[row : row + count]))
    away = np.flatnonzero(~(np.abs(mine - held_m) < FLAT_M))
    first = int(np.max(away[away < row + count // 2], initial=-1)) + 1
    last = int(np.min(away[away > row + count // 2], initial=len(mine))) - 1
    beside = mine[[max(first - JUMP_ROWS, 0), min(last + JUMP_ROWS, len(mine) - 1)]]
    jumps = int(np.count_nonzero(np.abs(beside - held_m) > JUMP_M))  # into it and out of it: no motion does that
    figures: dict[str, float | str] = {
        "seconds": float(grid[last] - grid[first]), "metres": FLAT_MOVED_M * float(moved[row]), "range_m": held_m
    }  # fmt: skip
    strength = float(moved[row]) * BY_JUMPS[jumps]
    return Sign(min(strength, 5.0), (float(grid[first]), float(grid[last])), figures)


def _moved(case: Case, window: Window) -> float | None:
    """How far the vehicle went up or down meanwhile, by the least of the other heights."""
    grid = np.arange(window[0], window[1], 0.2)
    if len(grid) < 3:
        return 0.0
    spans = [float(np.ptp(running_median(np.interp(grid, *of), 5))) for of in case.other_heights.values()]
    if case.inertial_velocity is not None:
        quick = np.interp(grid, case.inertial_velocity[0], case.inertial_velocity[1][:, 2])
        spans.append(float(np.ptp(np.cumsum(quick - quick.mean()) * 0.2)))
    return float(np.median(spans)) if spans else None


def _other_traces(case: Case) -> list[Trace]:
    roles = {"barometer": "estimate", "GPS": "gps", "autopilot": "autopilot"}
    return [Trace(roles[name], name, *of) for name, of in case.other_heights.items()]


def spikes(case: Case) -> Found:
    """Single ranges, or a few, far from those around."""
    if case.ranges is None:
        return NO_RANGE
    t_s, range_m = case.ranges
    middle = running_median(range_m, 11)
    inside = (t_s >= case.flight_s[0]) & (t_s <= case.flight_s[1])
    far = (np.abs(range_m - middle) > SPIKE_M + SPIKE_SHARE * middle) & inside
    share = float(far.sum() / max(inside.sum(), 1))
    size = float(np.median(np.abs(range_m - middle)[far])) if far.any() else 0.0
    window = _window(t_s, far, case.flight_s) if far.sum() > 3 else case.flight_s
    picture = Picture(
        "range (m)",
        (
            Trace("truth", "range", t_s[~far], range_m[~far], dots=True),
            Trace("flow", "echoes", t_s[far], range_m[far], dots=True),
        ),
    )
    return Sign(share / SPIKES, window, {"share": 100.0 * share, "metres": size}, (picture,))


def terrain(case: Case) -> Found:
    """The ground's height steps: the range jumps and stays while nothing else moves."""
    if case.range_height is None:
        return NO_RANGE
    t_s, height_m = case.range_height
    if len(t_s) < 50:
        return NO_RANGE
    inside = (t_s > case.flight_s[0] + 1.5) & (t_s < case.flight_s[1] - 1.5)
    before, after = np.interp(t_s - STEP_S, t_s, height_m), np.interp(t_s + STEP_S, t_s, height_m)
    step = _unmoved(case, t_s, after - before)
    steady = _steady(t_s, height_m)
    rows = stretches((np.abs(step) > STEP_M) & inside & steady)
    found = [(float(t_s[a]), float(step[a : b + 1][np.argmax(np.abs(step[a : b + 1]))])) for a, b in rows]
    found = [(when, size) for when, size in found if _stays(t_s, height_m, when, size)]
    if not found:
        return nothing(case.flight_s)
    largest = max(found, key=lambda one: abs(one[1]))
    window = (found[0][0], found[-1][0])
    figures: dict[str, float | str] = {"metres": abs(largest[1]), "count": float(len(found)), "at_s": largest[0]}
    picture = Picture("height (m)", (Trace("truth", "range", *case.range_height), *_other_traces(case)))
    return Sign(min(abs(largest[1]) / STEP_M, 4.0) * _harm_of_steps(case, found), window, figures, (picture,))


def _unmoved(case: Case, t_s: Array, step: Array) -> Array:
    """The change of the range over the two STEP_S less the vehicle's own motion, of each witness of that motion the one
    that leaves least: a step of the ground is one to all of them.
    """
    witnesses = []
    if case.inertial_velocity is not None and case.base is not None:
        witnesses.append((case.base.estimate_rows.t_s, case.base.estimate_rows.vel_ned_m_s[:, 2]))
    if case.own is not None and case.own.states_velocity:
        witnesses.append((case.own.t_s, case.own.vel_ned_m_s[:, 2]))
    if not witnesses:
        return step
    left = np.array([step + _went_down(*of, t_s) for of in witnesses])
    return np.asarray(np.take_along_axis(left, np.argmin(np.abs(left), axis=0)[None], axis=0)[0])


def _went_down(times: Array, down_m_s: Array, t_s: Array) -> Array:
    """How far a velocity leads down within STEP_S of each instant [m]."""
    path = integrated(down_m_s, np.diff(times))
    return np.asarray(np.interp(t_s + STEP_S, times, path) - np.interp(t_s - STEP_S, times, path))


def _harm_of_steps(case: Case, found: list[tuple[float, float]]) -> float:
    """1 where a step of the ground does harm: the range is the height's source, the only one, or its own height
    stepped with it; else little.
    """
    if any(one.height == RANGE for one in case.own_settings.sets):
        return 1.0
    if case.own is not None and not case.own_settings.sets:
        height = -case.own.pos_ned_m[:, 2]
        moved = [np.interp(t + 0.8, case.own.t_s, height) - np.interp(t - 0.8, case.own.t_s, height) for t, _ in found]
        followed = np.median([-change / size if size else 0.0 for change, (_, size) in zip(moved, found, strict=True)])
        return 1.0 if abs(followed) > FOLLOWED else HARMLESS
    alone = not case.own_settings.sets and not ({Sensor.BARO, Sensor.GPS_POSITION} & case.log.streams.keys())
    return 1.0 if alone else HARMLESS


def _steady(t_s: Array, height_m: Array) -> Flags:
    """Where the height a second before and after is that of half a second: no echo, no climb."""
    early = np.abs(np.interp(t_s - 1.0, t_s, height_m) - np.interp(t_s - STEP_S, t_s, height_m))
    late = np.abs(np.interp(t_s + 1.0, t_s, height_m) - np.interp(t_s + STEP_S, t_s, height_m))
    return np.asarray((early < 0.9) & (late < 0.9))


def _stays(t_s: Array, height_m: Array, when: float, size: float) -> bool:
    around = (
        (t_s > when - HELD_S - STEP_S) & (t_s < when - STEP_S),
        (t_s > when + STEP_S) & (t_s < when + HELD_S + STEP_S),
    )
    if not (around[0].any() and around[1].any()):
        return False
    change = float(np.median(height_m[around[1]]) - np.median(height_m[around[0]]))
    return bool(np.sign(change) == np.sign(size) and abs(change) > 0.6 * abs(size))


def wash(case: Case) -> Found:
    """A barometer that changes with the rotors: off from the range as soon as they lift."""
    baro = case.stream(Sensor.BARO)
    if baro is None:
        return Lack("no barometer")
    if case.range_height is None:
        return Lack("no range to hold the barometer against")
    start, end = case.flight_s
    t_s = baro.t_s - baro.delay_s
    near = gap_near(case.range_height[0], t_s) < 0.5
    stands = ~near & ((t_s < start) | (t_s > end)) & case.flew  # nearer than the range reads
    height_m = np.where(stands, 0.0, np.interp(t_s, *case.range_height) - case.ground_range_m)
    near |= stands & _landed_range(case)
    off = baro.value[:, 0] - height_m
    around = {
        "rest": near & (t_s < start - SPOOL_S),
        "up": near & (t_s > start + SPOOL_S) & (t_s < end - SPOOL_S),
        "before": near & (t_s < start - SPOOL_S) & (t_s > start - SPOOL_S - BESIDE_S),
        "after": near & (t_s > start + SPOOL_S) & (t_s < start + SPOOL_S + BESIDE_S),
        "last": near & (t_s < end - SPOOL_S) & (t_s > end - SPOOL_S - BESIDE_S),
        "down": near & (t_s > end + SPOOL_S) & (t_s < end + SPOOL_S + BESIDE_S),
    }
    means = {name: float(np.median(off[rows])) for name, rows in around.items() if rows.sum() >= LEAST_PRESSURES}
    pairs = (("up", "rest"), ("after", "before"), ("last", "down"))
    changes = [means[up] - means[rest] for up, rest in pairs if up in means and rest in means]
    if not changes:
        return Lack("no stretch on the ground before take-off or after landing to compare the pressure with")
    change = float(np.median(changes)) if len(changes) > 2 else float(min(changes, key=abs))
    zero = means.get("rest", means.get("down", 0.0))
    picture = Picture(
        "barometer less range (m)",
        (Trace("estimate", "barometer less range", t_s[near], off[near] - zero),),
        "Over level ground it stays where it was before take-off.",
    )
    held = [one.height for one in case.own_settings.sets if one.height is not None][:1]
    harm = 1.0 if not held or held[0] == BARO else NOT_THE_HEIGHT
    return Sign(harm * abs(change) / WASH_M, (start, end), {"metres": change}, (picture,))


def _landed_range(case: Case) -> bool:
    """Whether the flight begins and ends where the range does: near the ground, so that none means standing on it."""
    assert case.range_height is not None
    edges = np.interp(case.flight_s, *case.range_height)
    return bool((edges < case.ground_range_m + GROUND_RANGE_M).all())


def _window(t_s: Array, flags: Flags, otherwise: Window) -> Window:
    rows = np.flatnonzero(flags)
    return (float(t_s[rows[0]]), float(t_s[rows[-1]])) if len(rows) else otherwise
