"""Noise of a flight: every standard normal that it draws, by name, and the normals themselves.

For finding which noise decided a flight; the kernel draws its own.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array
from flownav.sensors.gps_ins import GpsInsNormals
from flownav.simulation import layout
from flownav.simulation.block import RECIRCULATION_CHANNEL
from flownav.simulation.ground import RecirculationState
from flownav.simulation.noise import CHANNELS_PER_STEP, threefry
from flownav.simulation.onboard import ALWAYS, EPOCH_S, PHYSICS_PERIOD_S, Clock, Onboard
from flownav.simulation.plan import Flight
from flownav.simulation.sensing import RANGE_EPOCHS
from flownav.simulation.sensor_table import SensorRow
from flownav.simulation.wind import WindNormals

SPARE = "spare"  # a field that makes a count even, and is drawn for nothing


class Start(NamedTuple):
    """A normal before the first epoch; row: of those from `layout.START_NORMALS` on."""

    name: str
    row: int


class Source(NamedTuple):
    """A normal of every reading of a clock: of the pair of this channel the first (half 0) or the second."""

    name: str
    channel: int
    half: int
    clock: Clock


def starts_of(flight: Flight) -> list[Start]:
    """The normals that are drawn once, before the first epoch, and matter to this flight."""
    onboard, drawn = flight.onboard, flight.plan.draws
    bundles: list[tuple[str, Any, int]] = []
    if drawn.gps_drift:
        bundles.append(("gps", GpsInsNormals, layout.GPS_NORMALS))
    if drawn.wind:
        bundles.append(("wind", WindNormals, layout.WIND_NORMALS))
    if drawn.recirculation:
        bundles.append(("recirculation", RecirculationState, layout.RECIRCULATION_NORMALS))
    if onboard is not None:
        bundles += _units(onboard)
    return [
        Start(f"start.{name}.{field}", row + k - layout.START_NORMALS)
        for name, bundle, row in bundles
        for k, field in enumerate(bundle._fields)
        if field != SPARE
    ]


def _units(s: Onboard) -> list[tuple[str, Any, int]]:
    """The units that the vehicle carries: the drawn errors of each, and its start."""
    return [
        (sensor.name, record, rows[sensor.name])
        for sensor in fitted_to(s)
        for record, rows in ((sensor.unit, layout.UNIT), (sensor.begun, layout.BEGUN))
        if record is not None
    ]


def fitted_to(s: Onboard) -> list[SensorRow]:
    """The sensors that the vehicle carries, in the order of their channels."""
    return [sensor for sensor in layout.BY_CHANNEL if getattr(s.carried, sensor.name).clock.fitted]


def sources_of(flight: Flight) -> list[Source]:
    """The normals that a flight draws as it goes."""
    onboard, drawn = flight.onboard, flight.plan.draws
    bundles: list[tuple[str, tuple[str, ...], int, Clock]] = []
    if drawn.paper:
        jitter = GpsInsNormals._fields.index("jitter_n")
        flow = (layout.FLOW_NORMALS - layout.GPS_NORMALS) // 2
        if drawn.gps_drift:
            bundles.append(("gps", GpsInsNormals._fields, 0, ALWAYS))
        else:
            bundles.append(("gps", GpsInsNormals._fields[jitter : jitter + 3], jitter // 2, ALWAYS))
        bundles.append(("flow", ("u", "v", "w"), flow, ALWAYS))
        bundles.append(("range", (SPARE, "noise"), flow + 1, ALWAYS._replace(every=RANGE_EPOCHS)))
    if drawn.wind:
        bundles.append(("wind", WindNormals._fields, (layout.WIND_NORMALS - layout.GPS_NORMALS) // 2, ALWAYS))
    if drawn.recirculation:
        bundles.append(("recirculation", RecirculationState._fields, RECIRCULATION_CHANNEL, ALWAYS))
    if onboard is not None:
        bundles += _readings(onboard)
    return [
        Source(f"{name}.{field}", channel + k // 2, k % 2, clock)
        for name, fields, channel, clock in bundles
        for k, field in enumerate(fields)
        if field != SPARE
    ]


def _readings(s: Onboard) -> list[tuple[str, tuple[str, ...], int, Clock]]:
    """The readings of the sensors that the vehicle carries; the inertial unit gives several an epoch."""
    found = []
    for sensor in fitted_to(s):
        fields, clock = sensor.normals._fields, getattr(s.carried, sensor.name).clock
        parts = 1 if sensor.on_epochs else round(EPOCH_S / (s.inertial_steps * PHYSICS_PERIOD_S))
        pairs = layout.in_pairs(sensor.normals) // 2
        found += [(sensor.name, fields, sensor.channels.reading + pairs * part, clock) for part in range(parts)]
    return found


def normals_of(seed: int, streams: NDArray[np.uint64], steps: NDArray[np.uint64], channel: int) -> Array:
    """`noise.normal_pair` of many streams and steps of one shape, (2, *shape); the same to the last bits or so."""
    counter = steps * CHANNELS_PER_STEP + np.uint64(channel)
    word0, word1 = threefry(streams, counter, np.full_like(counter, seed), np.zeros_like(counter))
    u = 1.0 - (word0 >> np.uint64(12)).astype(float) * 2.0**-52
    turn = ((word1 << np.uint64(2)) >> np.uint64(12)).astype(float) * 2.0**-52 - 0.5
    angle = 0.5 * np.pi * (turn + (word1 >> np.uint64(62)).astype(float))
    return np.asarray(np.sqrt(-2.0 * np.log(u)) * np.stack([np.cos(angle), np.sin(angle)]))
