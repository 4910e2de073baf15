"""Readings as a vehicle hands them to the library: delayed, looked for a while, in order of arrival; and spoilt."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Sensor, merge
from flownav.export.onboard.board import NOTHING
from flownav.export.onboard.interface import Rates
from flownav.export.onboard.package import Flight, pace_of, packed_settings
from flownav.logs.log import FedSegment, mean_over
from flownav.navigation import progress
from flownav.navigation.kernel_settings import NO_STATED_NOISE, FlowNoise
from flownav.navigation.rings import Given, numbers_of
from flownav.navigation.settings import NavigatorSettingsFile
from navigation_streams import Flown, equipment

RATES = Rates(0.27, 100.0, 150.0, 0.0, 0.05)
GPS_DELAY_S, EXPOSURE_S = 0.2, 0.05
GPS = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)


class Heard(NamedTuple):
    """A reading: when it is passed on, and itself."""

    handed_s: float
    given: Given


def flight_of(flown: Flown, noise: FlowNoise = NO_STATED_NOISE, **settings: float) -> Flight:
    """A flight whose streams are these."""
    queue = merge(flown.streams.values())
    segment = FedSegment(equipment(flown, queue, **settings)._asdict(), queue)
    return Flight("streams", segment, NavigatorSettingsFile(**settings), noise)


def settings_of(flight: Flight, without: tuple[str, ...] = (), **pace: float) -> tuple[np.ndarray, bool]:
    """Packed settings, and whether they carry the sensor's lag."""
    usual = pace_of(flight.settings, RATES.horizon_s, without)
    return packed_settings(flight, usual._replace(**pace))


def arriving(flown: Flown, seed: int = 1, late_s: float = 0.03) -> list[Given]:
    """The streams' readings as they come in: GPS is old, flow looked for a while, all are passed on a little late."""
    random = np.random.default_rng(seed)
    heard = []
    for sensor, stream in flown.streams.items():
        flow, gps = sensor == Sensor.FLOW_RATE, sensor in GPS
        for k, t_s in enumerate(stream.t_s):
            arrives_s = t_s + (GPS_DELAY_S if gps else 0.5 * EXPOSURE_S if flow else 0.0)
            numbers = numbers_of(
                stream.value[k, :2] if flow else stream.value[k], stream.variance[k], stream.quality[k],
                delay_s=arrives_s - t_s, exposure_s=EXPOSURE_S if flow else 0.0,
            )  # fmt: skip
            given = Given(arrives_s, int(sensor), numbers)
            heard.append(Heard(arrives_s + random.uniform(0.0, late_s) * (sensor != Sensor.IMU), given))
    return [each.given for each in sorted(heard, key=lambda each: each.handed_s)]


def as_prepared(readings: Sequence[Given]) -> list[Given]:
    """The same in the order of the instants that they describe, with the turning found by NumPy: no delay is left."""
    imu = np.array([[g.t_s, *g.numbers[:3]] for g in readings if g.sensor == Sensor.IMU])
    found = []
    for order, given in enumerate(readings):
        t_s, numbers = given.t_s - given.numbers[10], given.numbers.copy()
        if given.sensor == Sensor.FLOW_RATE:
            begin = int(np.searchsorted(imu[:, 0], given.t_s - 2.0 * EXPOSURE_S, side="right")) - 1
            rows, bounds = imu[max(begin, 0) :], np.array([given.t_s - EXPOSURE_S, given.t_s])
            turning = mean_over(rows[:, 0], rows[:, 1:], bounds[:1], bounds[1:])[0, :2]
            numbers[2:6] = *turning, *turning
        numbers[10:12] = 0.0
        found.append((t_s, order, Given(t_s, given.sensor, numbers)))
    return [given for _, _, given in sorted(found, key=lambda each: each[:2])]


# -- spoilt -------------------------------------------------------------------------------------------------
ODD = (np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-300, 0.0, -1.0, 255.0, 1e9)
LEAPS_S = (1000.0, -1000.0, 0.3, 0.7, -0.7, 20.0, 1e12, np.nan, np.inf, -np.inf)
SENSORS = (0, -1, 99, 255, 10**9, *map(int, Sensor))


def spoilt(readings: Sequence[Given], seed: int) -> list[Given]:
    """Some numbers are garbage; readings stay away, come twice, too late, in another order or with another's time."""
    random = np.random.default_rng(seed)
    share = random.uniform(0.02, 0.3)
    found: list[Given] = []
    shift_s = 0.0
    for given in readings:
        given = Given(given.t_s + shift_s, given.sensor, given.numbers.copy())
        if random.random() > share:
            found.append(given)
            continue
        what = random.integers(8)
        if what == 0:
            given.numbers[random.integers(len(given.numbers))] = random.choice(ODD)
        elif what == 1:
            given = given._replace(t_s=given.t_s + random.choice(LEAPS_S))
        elif what == 2:
            given = given._replace(sensor=int(random.choice(SENSORS)))
        elif what == 3:
            found.append(given)
        elif what == 4 and found:
            found.insert(max(0, len(found) - int(random.integers(1, 12))), given)
            continue
        elif what == 5:
            continue
        elif what == 6:
            shift_s += random.choice([0.0, 0.2, 0.6, 15.0, 1000.0])
        else:
            given.numbers[: random.integers(1, 13)] = random.choice(ODD)
        found.append(given)
    return [*found, NOTHING, NOTHING]


assert progress.STATUSES.keys() >= {"LATE", "NOT_BELIEVED"}
