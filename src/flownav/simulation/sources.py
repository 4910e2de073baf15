"""What the noise of a flight is: every standard normal that it draws, by name, and the normals themselves.

For those who ask which noise made a flight what it was; the kernel draws its own.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.sensors.barometer import BarometerNormals, BarometerStartNormals, BarometerUnit
from flownav.sensors.flow_camera import FlowCameraNormals, FlowCameraStartNormals, FlowCameraUnit
from flownav.sensors.gps_ins import GpsInsNormals
from flownav.sensors.gps_receiver import GpsReceiverNormals, GpsReceiverStartNormals, GpsReceiverUnit
from flownav.sensors.inertial import InertialNormals, InertialStartNormals, InertialUnit
from flownav.sensors.magnetometer import MagnetometerNormals, MagnetometerUnit
from flownav.sensors.pad_camera import PadCameraNormals, PadCameraUnit
from flownav.sensors.range_sensor import RangeSensorNormals, RangeSensorUnit
from flownav.sensors.skid_switch import SkidSwitchNormals, SkidSwitchUnit
from flownav.simulation import draws, layout
from flownav.simulation.noise import CHANNELS_PER_STEP, threefry
from flownav.simulation.onboard import EPOCH_S, PHYSICS_PERIOD_S, Clock, Onboard
from flownav.simulation.plan import Flight
from flownav.simulation.recirculation import RecirculationState
from flownav.simulation.sensing import RANGE_EPOCHS
from flownav.simulation.wind import WindNormals

Array = NDArray[np.float64]

ALWAYS = Clock(fitted=1, every=1, first=0)
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
    """The units that the vehicle carries: what each is, and how it starts."""
    units: list[tuple[str, Clock, tuple[tuple[Any, int], ...]]] = [
        ("inertial", ALWAYS,
         ((InertialUnit, layout.INERTIAL_DRAWN), (InertialStartNormals, layout.INERTIAL_BEGUN))),
        ("gps_receiver", s.receiver_clock,
         ((GpsReceiverUnit, layout.RECEIVER_DRAWN), (GpsReceiverStartNormals, layout.RECEIVER_BEGUN))),
        ("flow_camera", s.camera_clock,
         ((FlowCameraUnit, layout.CAMERA_DRAWN), (FlowCameraStartNormals, layout.CAMERA_BEGUN))),
        ("range_sensor", s.range_clock, ((RangeSensorUnit, layout.RANGE_DRAWN),)),
        ("barometer", s.baro_clock, ((BarometerUnit, layout.BARO_DRAWN), (BarometerStartNormals, layout.BARO_BEGUN))),
        ("magnetometer", s.mag_clock, ((MagnetometerUnit, layout.MAG_DRAWN),)),
        ("pad_camera", s.pad_clock, ((PadCameraUnit, layout.PAD_DRAWN),)),
        ("skid_switch", s.skid_clock, ((SkidSwitchUnit, layout.SKID_DRAWN),)),
    ]  # fmt: skip
    return [(name, bundle, row) for name, clock, own in units if clock.fitted for bundle, row in own]


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
        bundles.append(("recirculation", RecirculationState._fields, draws.RECIRCULATION_CHANNEL, ALWAYS))
    if onboard is not None:
        bundles += _readings(onboard)
    return [
        Source(f"{name}.{field}", channel + k // 2, k % 2, clock)
        for name, fields, channel, clock in bundles
        for k, field in enumerate(fields)
        if field != SPARE
    ]


def _readings(s: Onboard) -> list[tuple[str, tuple[str, ...], int, Clock]]:
    """The readings of the sensors that the vehicle carries."""
    parts = round(EPOCH_S / (s.inertial_steps * PHYSICS_PERIOD_S))
    inertial = [
        ("inertial", InertialNormals._fields, draws.INERTIAL_CHANNEL + 6 * part, ALWAYS) for part in range(parts)
    ]
    others = (
        ("gps_receiver", GpsReceiverNormals._fields, draws.RECEIVER_CHANNEL, s.receiver_clock),
        ("flow_camera", FlowCameraNormals._fields, draws.CAMERA_CHANNEL, s.camera_clock),
        ("range_sensor", RangeSensorNormals._fields, draws.RANGE_CHANNEL, s.range_clock),
        ("barometer", BarometerNormals._fields, draws.BARO_CHANNEL, s.baro_clock),
        ("magnetometer", MagnetometerNormals._fields, draws.MAG_CHANNEL, s.mag_clock),
        ("pad_camera", PadCameraNormals._fields, draws.PAD_CHANNEL, s.pad_clock),
        ("skid_switch", SkidSwitchNormals._fields, draws.SKID_CHANNEL, s.skid_clock),
    )
    return [*inertial, *(one for one in others if one[3].fitted)]


def normals_of(seed: int, streams: NDArray[np.uint64], steps: NDArray[np.uint64], channel: int) -> Array:
    """`noise.normal_pair` of many streams and steps of one shape, (2, *shape); the same to the last bits or so."""
    counter = steps * CHANNELS_PER_STEP + np.uint64(channel)
    word0, word1 = threefry(streams, counter, np.full_like(counter, seed), np.zeros_like(counter))
    u = 1.0 - (word0 >> np.uint64(12)).astype(float) * 2.0**-52
    turn = ((word1 << np.uint64(2)) >> np.uint64(12)).astype(float) * 2.0**-52 - 0.5
    angle = 0.5 * np.pi * (turn + (word1 >> np.uint64(62)).astype(float))
    return np.asarray(np.sqrt(-2.0 * np.log(u)) * np.stack([np.cos(angle), np.sin(angle)]))
