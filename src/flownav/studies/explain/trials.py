"""Hypotheses tried: the log replayed with a sensor withheld, rescaled, shifted or turned, and what that explains.

What a trial explains is the share that goes of how far the readings, taken at their word, lie from the path of the
replay with the repair: flow times range, the height's source, GPS.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flownav.core.frames import rotation_from_quaternion
from flownav.core.measurement import Array, Sensor, Stream
from flownav.logs.log import attitude_at
from flownav.replays.prepare import GPS, ReplayOptions
from flownav.replays.session import Replay
from flownav.studies.explain.astray import Astray, astray
from flownav.studies.explain.autopilot_settings import RANGE
from flownav.studies.explain.case import Case
from flownav.studies.explain.sign import Sign
from flownav.studies.explain.signals import Flags, at, running_mean

LARGEST_SQUARE = 25.0
LEAST_EXCESS = 0.15
LEAST_TESTED = 20
USUAL_DELAY_S, SMOOTH_S = 0.06, 0.3
FLOW_FLOOR_M_S, HEIGHT_FLOOR_M, PLACE_FLOOR_M, SPEED_FLOOR_M_S = 0.20, 0.6, 3.0, 0.45  # what sound sensors are off by

Streams = dict[Sensor, Stream]


class Repair(NamedTuple):
    """The log as a hypothesis has it mended: streams, options, in words, and what is withheld of it."""

    streams: Streams
    options: ReplayOptions
    words: str
    withheld: tuple[Sensor, ...] = ()


class Trial(NamedTuple):
    """explained: share of the innovations' excess, None where there is none to explain. astray: how far the
    autopilot's own estimate was off within the sign's window; None where nothing shows it.
    """

    words: str
    explained: float | None
    astray: Astray | None


Repairing = Callable[[Case, Sign], Repair]


def _with(case: Case, words: str, *changed: Stream) -> Repair:
    return Repair({**case.log.streams, **{one.sensor: one for one in changed}}, case.options, words)


def _number(sign: Sign, name: str) -> float:
    return float(sign.figures[name])


def without(words: str, *sensors: Sensor) -> Repairing:
    """A sensor withheld while the sign lasts."""

    def repair(case: Case, sign: Sign) -> Repair:
        streams = dict(case.log.streams)
        for sensor in sensors:
            if sensor in streams:
                streams[sensor] = _cut(
                    streams[sensor], (streams[sensor].t_s < sign.window_s[0]) | (streams[sensor].t_s > sign.window_s[1])
                )
        streams = {sensor: one for sensor, one in streams.items() if len(one)}
        return Repair(streams, case.options, words, sensors)

    repair.__doc__ = words  # for the page of the cause
    return repair


def _cut(one: Stream, kept: Flags) -> Stream:
    return replace(
        one, t_s=one.t_s[kept], value=one.value[kept], variance=one.variance[kept], quality=one.quality[kept]
    )


def turned_back(case: Case, sign: Sign) -> Repair:
    """The flow's axes turned back, its gyro's with them."""
    one = case.log.streams[Sensor.FLOW_RATE]
    u, _, v = np.linalg.svd(case.flow_fit.matrix if case.flow_fit is not None else np.eye(2))
    value = one.value.copy()
    value[:, :2] = value[:, :2] @ (u @ v)  # by the transpose of the turn nearest to the fit, which may be singular
    value[:, 2:4] = np.nan  # the vehicle's own rates serve
    return _with(case, "flow turned back, the vehicle's gyro", replace(one, value=value))


def rescaled(case: Case, sign: Sign) -> Repair:
    """The flow over its gain."""
    one = case.log.streams[Sensor.FLOW_RATE]
    value = one.value.copy()
    value[:, :2] /= _number(sign, "gain")
    return _with(case, "flow rescaled", replace(one, value=value))


def at_its_rate(case: Case, sign: Sign) -> Repair:
    """Flow and its gyro over the factor by which their time is wrong."""
    one = case.log.streams[Sensor.FLOW_RATE]
    return _with(case, "flow over its own time", replace(one, value=one.value / _number(sign, "slope")))


def without_offset(case: Case, sign: Sign) -> Repair:
    """The flow less what it reads where nothing moves."""
    one = case.log.streams[Sensor.FLOW_RATE]
    value = one.value.copy()
    value[:, :2] -= [_number(sign, "x"), _number(sign, "y")]
    return _with(case, "flow less its offset", replace(one, value=value))


def in_time(case: Case, sign: Sign) -> Repair:
    """The flow when it was taken."""
    one = case.log.streams[Sensor.FLOW_RATE]
    return _with(case, "flow at its own time", replace(one, t_s=one.t_s - 1e-3 * _number(sign, "lag_ms")))


def other_gyro(case: Case, sign: Sign) -> Repair:
    """The turning taken off with the vehicle's gyro."""
    one = case.log.streams[Sensor.FLOW_RATE]
    value = one.value.copy()
    value[:, 2:4] = np.nan
    return _with(case, "the vehicle's gyro in the flow", replace(one, value=value))


def above(case: Case, sign: Sign) -> Repair:
    """No flow below the height from which it is sound."""
    one, flow = case.log.streams[Sensor.FLOW_RATE], case.flow
    assert flow is not None
    low = np.nan_to_num(flow.range_m, nan=9.0) < _number(sign, "height_m") + case.ground_range_m
    return _with(case, "no flow near the ground", replace(one, quality=np.where(low, 0.0, one.quality)))


def without_echoes(case: Case, sign: Sign) -> Repair:
    """The ranges without those far from their neighbours."""
    from flownav.lab.identification.flight import spikes

    one = case.log.streams[Sensor.RANGE]
    return _with(case, "ranges without echoes", _cut(one, ~spikes(one.value[:, 0])))


def gps_in_time(case: Case, sign: Sign) -> Repair:
    """GPS at the delay that it has."""
    options = replace(case.options, gps_delay_s=float(np.clip(1e-3 * _number(sign, "lag_ms"), 0.0, 2.0)))
    return Repair(dict(case.log.streams), options, "GPS at the delay found")


# -- scores ------------------------------------------------------------------------------------------------------
class Mismatch(NamedTuple):
    """Distance of the sensors' readings from a path, over that of sound ones, squared and capped; 1 is sound."""

    flow: float
    height: float
    place: float

    @property
    def excess(self) -> float:
        """The sum of the amounts above 1, which is sound."""
        return sum(max(one - 1.0, 0.0) for one in self)


def tried(case: Case, sign: Sign, repairing: Repairing | None) -> Trial:
    """The replay with the repair, and how near to its path the readings are with the repair and as they were.

    A filter that refuses what is wrong hides it; so the readings are taken at their word: flow times range in the
    log's own heading, the height of its source, GPS as it comes.
    """
    if repairing is None:
        return Trial(
            "nothing to replay: parameters and log decide",
            None,
            astray(case, case.base, sign.window_s, gps_is_blamed=False),
        )
    repair = repairing(case, sign)
    run = case.replayed(repair.streams, repair.options)
    if run is None:
        return Trial(f"{repair.words}: cannot be replayed", None, None)
    before = mismatch(case, case.log.streams, run, case.attitude, case.options)
    attitude = run.attitude if Sensor.MAG in repair.withheld else case.attitude
    after = mismatch(case, repair.streams, run, attitude, repair.options)
    share = None if before.excess < LEAST_EXCESS else float(np.clip(1.0 - after.excess / before.excess, -1.0, 1.0))
    gps_is_blamed = bool(set(GPS) & set(repair.withheld)) or repair.options != case.options
    return Trial(repair.words, share, astray(case, run, sign.window_s, gps_is_blamed=gps_is_blamed))


def mismatch(case: Case, streams: Streams, run: Replay, attitude: Stream | None, options: ReplayOptions) -> Mismatch:
    """Flow, height and GPS at their word against the path of a replay, in flight."""
    return Mismatch(
        _of_flow(case, streams, run, attitude), _of_height(case, streams, run), _of_place(case, streams, run, options)
    )


def _capped(off: Array, floor: float) -> float:
    squares = np.minimum((off / floor) ** 2, LARGEST_SQUARE)
    return float(np.mean(squares)) if len(off) >= LEAST_TESTED else 1.0


def _of_flow(case: Case, streams: Streams, run: Replay, attitude: Stream | None) -> float:
    flow, distance = streams.get(Sensor.FLOW_RATE), streams.get(Sensor.RANGE)
    if flow is None or distance is None or attitude is None or case.rates is None:
        return 1.0
    good = (flow.quality > 0.0) & case.lifted(flow.t_s) & np.isfinite(flow.value[:, :2]).all(axis=1)
    valid = distance.quality > 0.0
    if good.sum() < LEAST_TESTED or valid.sum() < LEAST_TESTED:
        return 1.0
    t_s = flow.t_s[good]
    lag = case.own_settings.flow_delay_s if case.own_settings.flow_delay_s is not None else USUAL_DELAY_S
    row = np.maximum(np.searchsorted(distance.t_s[valid], t_s, side="right") - 1, 0)
    far = distance.value[valid][row, 0]
    ours = at(case.rates[0], case.rates[1][:, :2], t_s - lag)
    own = flow.value[good, 2:4]
    seen = flow.value[good, :2] - np.where(np.isfinite(own), own, ours)
    u, v = seen[:, 1] * far, -seen[:, 0] * far
    r = rotation_from_quaternion(*attitude_at(attitude, t_s - lag).T)
    earth = np.column_stack([r[0] * u + r[1] * v, r[3] * u + r[4] * v])
    count = max(1, round(SMOOTH_S / max(float(np.median(np.diff(t_s))), 1e-3)))
    apart = running_mean(earth, count) - at(run.estimate_rows.t_s, run.estimate_rows.vel_ned_m_s[:, :2], t_s - lag)
    return _capped(np.hypot(*apart.T), FLOW_FLOOR_M_S)


def _of_height(case: Case, streams: Streams, run: Replay) -> float:
    """Mismatch of the height's source that is set in the autopilot; of the barometer where none is set."""
    one = case.own_settings.set_at(1)
    source = Sensor.RANGE if one is not None and one.height == RANGE else Sensor.BARO
    stream = streams.get(source)
    if stream is None:
        return 1.0
    good = case.lifted(stream.t_s) & (stream.quality > 0.0)
    height = stream.value[good, 0]
    ours = -np.interp(stream.t_s[good] - stream.delay_s, run.estimate_rows.t_s, run.estimate_rows.pos_ned_m[:, 2])
    ground = float(np.median(stream.value[:LEAST_TESTED, 0])) if source == Sensor.BARO else case.ground_range_m
    start = -float(np.interp(case.flight_s[0] - 1.0, run.estimate_rows.t_s, run.estimate_rows.pos_ned_m[:, 2]))
    return _capped((height - ground) - (ours - start), HEIGHT_FLOOR_M)


def _of_place(case: Case, streams: Streams, run: Replay, options: ReplayOptions) -> float:
    place, speed = (streams.get(sensor) for sensor in GPS)
    if place is None or speed is None:
        return 1.0
    inside = (place.t_s > case.flight_s[0]) & (place.t_s < case.flight_s[1])
    at_s = place.t_s[inside] - options.gps_delay_s
    apart = place.value[inside, :2] - at(run.estimate_rows.t_s, run.estimate_rows.pos_ned_m[:, :2], at_s)
    moved = speed.value[(speed.t_s > case.flight_s[0]) & (speed.t_s < case.flight_s[1]), :2]
    other = at(
        run.estimate_rows.t_s,
        run.estimate_rows.vel_ned_m_s[:, :2],
        speed.t_s[(speed.t_s > case.flight_s[0]) & (speed.t_s < case.flight_s[1])] - options.gps_delay_s,
    )
    level = np.hypot(*(apart - np.median(apart, axis=0)).T) if len(apart) else np.zeros(0)
    return max(_capped(level, PLACE_FLOOR_M), _capped(np.hypot(*np.nan_to_num(moved - other).T), SPEED_FLOOR_M_S))
