"""Inertial sensors beside each other: one whose accelerometer is stuck gives way before the navigator has seen it."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import numpy as np
import pytest

from flownav.core.measurement import Measurement, Sensor
from flownav.estimation.gating import Reason
from flownav.live.filtering import ROOM
from flownav.live.horizon import Source
from flownav.live.inertial import (
    AGREED_S,
    BEFORE_S,
    DOUBTED_S,
    HIGHER_M,
    MOST_COMPARED,
    MOST_KEPT,
    RECOVERED_S,
    Heights,
    Inertial,
)
from flownav.logs.mavlink import outgoing as say
from flownav.navigation import waiting
from flownav.navigation.rings import Given, Rings, numbers_of
from flownav.navigation.rows import InnovationRow
from live_ends import Hover, Wire

FIRST, SECOND = Source("RAW_IMU", 0), Source("SCALED_IMU2", 0)
LEVEL = (0.0, 0.0, -9.81)
NAN = math.nan


def reading(t_s, force=LEVEL, turn=0.0):
    return Measurement(t_s, Sensor.IMU, (turn, 0.0, 0.0, *force), (NAN,) * 6)


def flown(inertial, until_s, force=lambda t_s: LEVEL, second=None, since_s=0.0, seed=1):
    """A sensor of 100 Hz that is shaken a little, and another of 50 beside it; the first swap, and when."""
    chance = random.Random(seed)
    for k in range(round((until_s - since_s) * 100)):
        t_s = since_s + 0.01 * k
        if second is not None and k % 2 == 0:
            inertial.received(SECOND, reading(t_s, second(t_s)), FIRST)
        swap = inertial.received(FIRST, reading(t_s, force(t_s), chance.gauss(0.0, 0.01)), FIRST)
        if swap is not None:
            return t_s, swap
    return None


def shaken(seed):
    chance = random.Random(seed)
    return lambda t_s: tuple(value + chance.gauss(0.0, 0.1) for value in LEVEL)


def stuck_from(t_stuck_s, value=(3.0, 3.0, 3.0)):
    usual = shaken(2)
    return lambda t_s: value if t_s >= t_stuck_s else usual(t_s)


def test_a_stuck_accelerometer_is_known_within_a_tenth_of_a_second():
    found = flown(Inertial(), 3.0, stuck_from(1.0))
    assert found is not None
    at_s, swap = found
    assert 1.0 <= at_s < 1.1
    assert swap.barred == FIRST
    assert swap.since_s <= 1.0 - 0.5 * BEFORE_S  # readings while an autopilot's filter settled are dropped, too
    assert swap.others == []


def test_another_s_readings_take_its_place():
    at_s, swap = flown(Inertial(), 3.0, stuck_from(1.0), second=shaken(3))
    assert at_s < 1.1
    assert len(swap.others) >= 4
    assert all(sample.t_s >= swap.since_s for sample in swap.others)
    assert all(math.dist(sample.reading.value[3:6], LEVEL) < 1.0 for sample in swap.others)


def test_a_quiet_vehicle_that_says_the_same_for_long_is_not_stuck():
    """ArduPilot tells thousandths of g: a helicopter that stands says the same for half a second."""
    assert flown(Inertial(), 20.0) is None


def test_one_that_errs_by_a_changing_amount_is_contradicted_by_the_other():
    usual = shaken(4)

    def errs(t_s):
        force = usual(t_s)
        return (force[0], force[1], force[2] + (4.0 if t_s >= 1.0 else 0.0))

    at_s, swap = flown(Inertial(), 3.0, errs, second=shaken(5))
    assert 1.0 <= at_s < 1.15
    assert swap.why == "contradicted"


def test_the_other_one_that_errs_is_not_believed():
    def errs(t_s):
        return (0.0, 0.0, -9.81 + (4.0 if t_s >= 1.0 else 0.0))

    assert flown(Inertial(), 3.0, shaken(6), second=errs) is None


def test_it_is_believed_again_once_it_is_not_stuck_any_more():
    inertial = Inertial()
    force = stuck_from(1.0)
    flown(inertial, 3.0, force)
    for k in range(200):
        inertial.received(FIRST, reading(1.2 + 0.01 * k, (3.0, 3.0, 3.0), 0.01 * (k % 7)), None)
    assert not inertial.recovered(FIRST, 3.2, alone=True)
    usual = shaken(7)
    for k in range(100):
        inertial.received(FIRST, reading(3.2 + 0.01 * k, usual(0.0), 0.01 * (k % 7)), None)
    assert inertial.recovered(FIRST, 3.2 + RECOVERED_S + 0.05, alone=True)


def test_a_stuck_one_whose_last_digit_flickers_stays_stuck():
    inertial, usual = Inertial(), shaken(2)

    def flickers(t_s):
        return (3.0, 3.0, 3.0 + 0.01 * (round(100 * t_s) // 9 % 2)) if t_s >= 1.0 else usual(t_s)

    for k in range(300):
        inertial.received(FIRST, reading(0.01 * k, flickers(0.01 * k), 0.01 * (k % 7)), None)
        assert k < 110 or not inertial.recovered(FIRST, 0.01 * k, alone=True)


def test_one_that_comes_back_to_what_it_said_before_is_not_stuck_there():
    """A quiet vehicle, whose accelerometer says the same for half a second as soon as it works again."""
    inertial = Inertial()
    for k in range(500):
        force = (3.0, 3.0, 3.0) if 100 <= k < 200 else (0.0, 0.0, -9.81 + 0.01 * (k // 50 % 2))
        inertial.received(FIRST, reading(0.01 * k, force, 0.01 * (k % 7)), None)
    assert inertial.recovered(FIRST, 2.0 + RECOVERED_S + 0.05, alone=True)


def test_of_three_the_one_that_is_alone_errs_whatever_gravity_says():
    """A vehicle that falls feels less of it than one of its accelerometers that is wrong."""
    inertial, third = Inertial(), Source("SCALED_IMU3", 0)
    chance = [shaken(seed) for seed in range(3)]
    for k in range(300):
        t_s = 0.01 * k
        falls = 5.0 if t_s >= 1.0 else 0.0
        force = [(x, y, z + falls) for x, y, z in (one(t_s) for one in chance)]
        wrong = (force[0][0], force[0][1], force[0][2] - falls)
        inertial.received(SECOND, reading(t_s, force[1]), FIRST)
        inertial.received(third, reading(t_s, force[2]), FIRST)
        swap = inertial.received(FIRST, reading(t_s, wrong), FIRST)
        if swap is not None:
            break
    assert 1.0 <= t_s < 1.15
    assert swap.why == "contradicted"


def test_one_that_was_contradicted_is_believed_again_when_it_agrees():
    """It was never stuck, and nothing was sent for 74 s."""
    inertial, usual = Inertial(), shaken(4)
    assert flown(inertial, 3.0, lambda t_s: (0.0, 0.0, -5.0 if t_s >= 1.0 else -9.81), second=usual) is not None
    for k in range(300):
        t_s = 1.2 + 0.01 * k
        inertial.received(FIRST, reading(t_s, (0.0, 0.0, -5.0 if t_s < 2.0 else -9.81)), SECOND, {FIRST})
        inertial.received(SECOND, reading(t_s, usual(t_s)), SECOND, {FIRST})
        if t_s < 2.0 + 0.5 * AGREED_S:
            assert not inertial.recovered(FIRST, t_s, alone=False)
    assert inertial.recovered(FIRST, 2.0 + AGREED_S + 0.15, alone=False)


def test_what_waits_at_the_horizon_is_taken_back():
    rings = Rings(ROOM, 64)
    for k in range(30):
        rings.take(Given(0.01 * k, int(Sensor.IMU), numbers_of((0.0, 0.0, 0.0, 0.0, 0.0, -9.8 - k))))
    for k in (3, 26, 21, 28):  # in another order: these wait beside the others
        rings.take(Given(0.01 * k - 0.001, int(Sensor.IMU), numbers_of((0.0, 0.0, 0.0, 0.0, 0.0, -9.8))))
    rings.take(Given(0.25, int(Sensor.BARO), numbers_of((1.0,))))
    assert rings.take_back(0.195) == 10 + 3
    left = rings.waiting()
    assert left.sensor.tolist().count(Sensor.IMU) == 20 + 1
    assert left.sensor.tolist().count(Sensor.BARO) == len(rings) - 21 == 1
    assert left.t_s.tolist() == sorted(left.t_s)
    assert left.t_s[left.sensor == Sensor.IMU].max() < 0.195
    assert rings.take(Given(0.2, int(Sensor.IMU), numbers_of((0.0, 0.0, 0.0, 0.0, 0.0, 9.8)))) == waiting.TAKEN
    assert rings.inertial()[-1].tolist() == [0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 9.8]  # which is no spike after what erred
    assert len(rings.inertial()) == 21
    assert rings.newest_inertial_s == 0.2


def test_what_was_fed_and_is_found_wrong_serves_for_the_way_to_now_no_more():
    rings, settings = Rings(ROOM, 64), np.zeros(1000)
    for k in range(30):
        rings.take(Given(0.01 * k, int(Sensor.IMU), numbers_of((0.0, 0.0, 0.0, 0.0, 0.0, -9.8))))
    assert len(rings.release(settings, 0.22).queue.t_s) == 23
    assert rings.take_back(0.195) == 7
    assert len(rings) == 0
    assert rings.inertial()[-1, 0] == 0.19
    assert rings.take(Given(0.21, int(Sensor.IMU), numbers_of((0.0,) * 6))) == waiting.LATE
    assert rings.take(Given(0.23, int(Sensor.IMU), numbers_of((0.0,) * 6))) == waiting.TAKEN


def test_a_flood_of_readings_costs_no_more_than_a_second_of_an_ordinary_sensor():
    """20 000 readings a second beside another sensor: what is kept and what is looked at has an end."""
    inertial, chance = Inertial(), random.Random(8)
    for k in range(20_000):
        t_s = 5e-5 * k
        inertial.received(FIRST, reading(t_s, (chance.gauss(0.0, 0.1), 0.0, -9.81)), FIRST)
        if k % 400 == 0:
            inertial.received(SECOND, reading(t_s), FIRST)
    flooded = inertial._histories[FIRST]
    assert len(flooded.kept) == MOST_KEPT
    looked = flooded.usual(t_s)
    assert looked.by_chance == pytest.approx(0.1 / math.sqrt(MOST_COMPARED), rel=0.5)


# -- a vehicle with several ---------------------------------------------------------------------------------
STUCK_S, WELL_S = 8.0, 14.0  # since when, and until when, on the vehicle's way


class Jolted(Hover):
    """It jolts up and down at 3 Hz while its first accelerometer is stuck at a value whose last digit flickers."""

    others = ("scaled_imu2", "scaled_imu3")

    def frames(self, t_s):
        self.imu = False
        told, step, time_us = super().frames(t_s), self.steps, round((self.boot_s + t_s) * 1e6)
        jolt = 7.0 * math.sin(6.0 * math.pi * (t_s - STUCK_S)) if STUCK_S <= t_s < WELL_S else 0.0
        rates, force = [[self.noise.gauss(0.0, sigma) for _ in range(3)] for sigma in (0.002, 0.02)]
        force[2] += jolt - 9.80665
        first = self.stuck(rates, step) if STUCK_S <= t_s < WELL_S else (*rates, *force)
        messages = [say.highres_imu(self.mav, time_us, Measurement(0.0, Sensor.IMU, first, (NAN,) * 6))]
        for number, name in enumerate(self.others if step % 2 == 0 else ()):
            felt = [round((value + 0.1 * number) / 9.80665e-3) for value in force]
            turns = [round(1e3 * value) for value in rates]
            messages.append(getattr(self.mav, f"{name}_encode")(time_us // 1000, *felt, *turns, 0, 0, 0))
        return [*told, *(bytes(message.pack(self.mav)) for message in messages)]

    def stuck(self, rates, step):
        return (*rates, 3.0, 3.0, 3.0 + 0.01 * (step // 9 % 2))


class JoltedWithTwo(Jolted):
    others = ("scaled_imu2",)


@pytest.mark.parametrize("vehicle", [Jolted, JoltedWithTwo])
def test_another_flies_on_while_the_first_is_stuck_however_the_vehicle_jolts(vehicle):
    wire = Wire(vehicle())
    wire.fly(20.0)
    told = [(t_s, m) for m, t_s in zip(wire.heard, wire.heard_s, strict=True) if m.msgname == "ODOMETRY" and t_s > 6.0]
    assert max(math.hypot(m.x, m.y) for _, m in told) < 0.5
    heights = [m.z for _, m in told]
    assert max(heights) - min(heights) < 0.5
    assert max(b - a for (a, _), (b, _) in pairwise(told)) < 0.2
    assert wire.session.resets == 1
    assert not wire.session.intake.sources.barred[Sensor.IMU]
    wire.close()


class Silenced(JoltedWithTwo):
    """In place of being stuck its first IMU sends six zeros, though all of them are marked as new."""

    def stuck(self, rates, step):
        return (0.0,) * 6


def test_six_zeros_of_highres_imu_are_no_reading():
    wire = Wire(Silenced())
    wire.fly(20.0)
    told = [(t_s, m) for m, t_s in zip(wire.heard, wire.heard_s, strict=True) if m.msgname == "ODOMETRY" and t_s > 6.0]
    heights = [m.z for _, m in told]
    assert max(heights) - min(heights) < 0.5
    assert max(b - a for (a, _), (b, _) in pairwise(told)) < 0.2
    assert wire.session.intake.counts["imu: no_data"] == round((WELL_S - STUCK_S) * 100)
    wire.close()


# -- heights --------------------------------------------------------------------------------------------------
def row(sensor, t_s, innovation, reason=Reason.FUSED, component=0):
    named = dict.fromkeys(InnovationRow._fields, NAN)
    named |= {"t_s": t_s, "sensor": float(sensor), "component": float(component), "innovation": innovation}
    return InnovationRow(**{**named, "reason": float(reason)})


def test_two_heights_that_say_the_same_and_loudly_are_right():
    heights = Heights()
    heights.judged([row(Sensor.BARO, 1.0, HIGHER_M + 0.1), row(Sensor.RANGE, 1.1, 0.9, Reason.INNOVATION_GATE)])
    assert heights.doubted(1.1)
    assert heights.doubted(1.1 + DOUBTED_S)
    assert not heights.doubted(1.11 + DOUBTED_S)
    heights.clear()
    assert not heights.doubted(1.1)


def test_gps_counts_height_down():
    heights = Heights()
    heights.judged(
        [row(Sensor.GPS_POSITION, 1.0, -1.0, component=2), row(Sensor.RANGE, 1.1, 0.9, Reason.INNOVATION_GATE)]
    )
    assert heights.doubted(1.1)


@pytest.mark.parametrize(
    "rows",
    [
        [row(Sensor.RANGE, 1.1, 0.9, Reason.INNOVATION_GATE)],  # the ground has a step
        [row(Sensor.BARO, 1.0, -1.0), row(Sensor.RANGE, 1.1, 0.9, Reason.INNOVATION_GATE)],
        [row(Sensor.BARO, 1.0, 0.6), row(Sensor.RANGE, 1.1, 0.5)],  # nobody shouts
        [row(Sensor.BARO, 1.0, 0.6), row(Sensor.RANGE, 2.1, 0.9, Reason.INNOVATION_GATE)],  # long after
        [row(Sensor.GPS_POSITION, 1.0, 5.0), row(Sensor.RANGE, 1.1, 0.9, Reason.INNOVATION_GATE)],  # north
    ],
)
def test_one_alone_or_two_of_two_minds_are_not(rows):
    heights = Heights()
    heights.judged(rows)
    assert not heights.doubted(rows[-1].t_s)
