"""Sensors that fail in flight: a reading on its way from its sensor becomes that of a failed one.

A fault is part of a flight's truth, unknown to navigator and autopilot: each lane has its own. It strikes the readings
that are taken in [begins_s, ends_s); the sizes are those of `faults.catalogue`, whose injectors do the same to a log,
and tests hold the two together.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, equation, exp, lane_access, magnitude, procedure
from flownav.core.measurement import Sensor
from flownav.navigation.records import Reading
from flownav.simulation import layout
from flownav.simulation.block import draw
from flownav.simulation.layout import FIELDS, PLANT, fault_as_is, load_slot, put_slot, reading_at, store_row
from flownav.simulation.records import HeldRange
from flownav.simulation.truth import SensorFault


class FaultNormals(NamedTuple):
    """Standard normals of one reading."""

    first: float
    second: float
    third: float
    fourth: float
    fifth: float
    sixth: float


load_held, store_held = PLANT.access(HeldRange)
load_normals, _ = lane_access(FaultNormals, layout.FAULT_NORMALS)


@equation
def even(normal: float) -> float:
    """A number that is uniform between 0 and 1, of a standard normal: its distribution function within 1e-14.

    J. F. Hart et al., Computer Approximations, 1968, number 5666, a rational function and exp(-x^2/2).
    """
    x = magnitude(normal)
    p = 33.912866078383 + x * (6.37396220353165 + x * (0.700383064443688 + x * 3.52624965998911e-02))
    p = 220.206867912376 + x * (221.213596169931 + x * (112.079291497871 + x * p))
    q = 86.7807322029461 + x * (16.064177579207 + x * (1.75566716318264 + x * 8.83883476483184e-02))
    q = 440.413735824752 + x * (793.826512519948 + x * (637.333633378831 + x * (296.564248779674 + x * q)))
    beyond = exp(-0.5 * x * x) * p / q
    return beyond if normal < 0.0 else 1.0 - beyond


@equation
def strikes(sensor: int, fault: SensorFault) -> bool:
    """Whether a fault is one of this sensor's."""
    if sensor == Sensor.IMU:
        return fault.inertial > 0.0
    if sensor == Sensor.GPS_POSITION:
        return fault.position > 0.0
    if sensor == Sensor.GPS_VELOCITY:
        return fault.velocity > 0.0
    if sensor == Sensor.FLOW_RATE:
        return fault.flow > 0.0
    if sensor == Sensor.RANGE:
        return fault.range > 0.0
    if sensor == Sensor.LANDED:
        return fault.skids > 0.0
    return fault.others > 0.0


@equation
def failed(read: Reading, earlier: Reading, held: float, since_s: float, n: FaultNormals, f: SensorFault) -> Reading:
    """The reading of a failed sensor in place of `read`, since_s after the fault began.

    earlier: its reading `f.late_readings` before; held: its first value before the fault.
    """
    source = earlier if f.late_readings > 0.0 else read
    x = f.m_xx * source.value_0 + f.m_xy * source.value_1 + f.bias_0 + f.drift_0 * since_s + f.noise_first * n.first
    y = f.m_yx * source.value_0 + f.m_yy * source.value_1 + f.bias_1 + f.drift_1 * since_s + f.noise_first * n.second
    x = f.even_to * (2.0 * even(n.first) - 1.0) if f.even_to > 0.0 else x
    y = f.even_to * (2.0 * even(n.second) - 1.0) if f.even_to > 0.0 else y
    spike = f.spike_share > 0.0 and even(n.third) < f.spike_share
    x = f.spike_low + (f.spike_high - f.spike_low) * even(n.fourth) if spike else x
    x = held if f.held > 0.0 else (f.always if np.isfinite(f.always) else x)
    within_s = since_s - f.blank_every_s * np.floor(since_s / f.blank_every_s)
    blank = f.lost > 0.0 or (f.blank_s > 0.0 and within_s < f.blank_s)
    gone = np.nan if blank else 0.0
    return Reading(
        x + gone,
        y + gone,
        source.value_2 + f.bias_2 + gone,
        source.value_3 + f.bias_3 + f.noise_last * n.fourth + gone,
        source.value_4 + f.bias_4 + f.noise_last * n.fifth + gone,
        source.value_5 + f.bias_5 + f.noise_last * n.sixth + gone,
        read.variance_0,
        read.variance_1,
        read.variance_2,
        f.quality if np.isfinite(f.quality) else read.quality,
        0.0 if f.lost > 0.0 else read.arrived,
        read.withheld,
    )


class Taken(NamedTuple):
    """A reading that was just put into a slot. channel: of its noise, the first; number: among those of its sensor."""

    epoch: int
    t_s: float
    slot: int
    sensor: int
    channel: int
    number: int


@procedure
def strike(work: Work, lanes: Lanes, seed: int, flight: int, taken: Taken) -> None:
    """The reading in a slot as each lane's fault has it."""
    sensor, slot, t_s = taken.sensor, taken.slot, taken.t_s
    draw(work, lanes, layout.FAULT_NORMALS, 6, seed, flight, taken.epoch, taken.channel)
    for lane in range(len(lanes)):
        fault, read = fault_as_is(work, lanes, lane), load_slot(work, lanes, slot, lane)
        struck, on = strikes(sensor, fault), t_s >= fault.begins_s and t_s < fault.ends_s
        earlier = read
        if sensor == Sensor.FLOW_RATE:
            earlier = remember(work, lanes, lane, read, taken.number, int(fault.late_readings))
        held = load_held(work, lanes, lane)
        if sensor == Sensor.RANGE and t_s < fault.begins_s and read.arrived > 0.0:
            held = HeldRange(read.value_0)
        store_held(work, lanes, lane, held)
        after = failed(read, earlier, held.range_m, t_s - fault.begins_s, load_normals(work, lanes, lane), fault)
        put_slot(work, lanes, slot, lane, after if struck and on else read)


@equation
def remember(work: Work, lanes: Lanes, lane: int, read: Reading, count: int, late: int) -> Reading:
    """Keep a reading among the last of its sensor; return the one that came `late` readings before."""
    kept = layout.FAULT_EARLIER + FIELDS * (count % layout.EARLIER_READINGS)
    store_row(work, lanes, kept, lane, read)
    row = layout.FAULT_EARLIER + FIELDS * ((count - late) % layout.EARLIER_READINGS)
    earlier: Reading = reading_at(work, lanes, row, lane)
    return earlier
