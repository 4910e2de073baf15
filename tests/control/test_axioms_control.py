"""Invariances of the autopilot: a turn of north, a mirror, a path that begins at another time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flownav.control.autopilot import Estimate, hovering, inner_loop, outer_loop, unexplained_acceleration
from flownav.control.gains import AutopilotGains
from flownav.control.guidance import Knowledge, Path, Reference, reference_at, rounded
from flownav.core.frames import GRAVITY_M_S2, quaternion_from_euler, rotation_from_quaternion, turned_about_down

SEEDS = pytest.mark.parametrize("seed", range(8))
GAINS = AutopilotGains(
    gust_share=0.4, gust_decay_forward=0.7, gust_decay_right=0.8, pitch_trim_sine=0.02, roll_trim_sine=0.09,
    skids_below_cg_m=0.3, land_height_m=1.5, land_speed_m_s=0.3, align_height_m=1.2, align_radius_m=0.4,
    align_speed_m_s=0.5, align_patience_s=4.0, commit_height_m=0.3, into_wind_rad_s=0.2,
)  # fmt: skip
KNOWN = Knowledge(pad_found=1.0, ground_found=1.0, pad_unseen_s=0.0, sigma_m=0.0, doubted=0.0)
STATE = hovering(GAINS)._replace(
    accel_forward=0.1, accel_right=-0.2, gust_forward=0.05, gust_right=0.07, collective=0.004, lon=0.01, lat=-0.02,
    pedal=0.03, waited_s=1.5, heading_north=0.6, heading_east=0.8, turn_rad_s=0.1, push_forward=0.3, push_right=-0.5,
)  # fmt: skip


def floats(rng: np.random.Generator, count: int, size: float = 1.0) -> tuple[float, ...]:
    return tuple(float(x) for x in size * rng.normal(size=count))


def about_down(pair, angle):
    cosine, sine = math.cos(angle), math.sin(angle)
    return cosine * pair[0] - sine * pair[1], sine * pair[0] + cosine * pair[1]


def drawn(rng: np.random.Generator):
    """Reference, estimate and attitude, near the pad and moving; some of them before the shut gate."""
    reference = Reference(*floats(rng, 2, 0.4), float(rng.uniform(-2.0, 0.0)), *floats(rng, 3, 0.3))
    place = (*floats(rng, 2, 0.4), float(rng.uniform(-2.0, -0.2)))
    estimate = Estimate(*place, *floats(rng, 3, 0.4), *floats(rng, 2, 0.5), -9.8)
    return reference, estimate, quaternion_from_euler(*floats(rng, 2, 0.1), float(rng.uniform(-3.0, 3.0)))


@SEEDS
def test_the_outer_loop_knows_no_north(seed):
    """Path, place and heading turned alike, through the gate over the pad too: the very same tilt and collective."""
    rng = np.random.default_rng(seed)
    reference, estimate, q = drawn(rng)
    found = outer_loop(STATE, reference, estimate, KNOWN, rotation_from_quaternion(*q), GAINS, 1.0, 0.02)
    for angle in (0.5 * math.pi, 1.9, -0.7):
        north, east = about_down((STATE.heading_north, STATE.heading_east), angle)
        other = outer_loop(
            STATE._replace(heading_north=north, heading_east=east),
            Reference(
                *about_down(reference[:2], angle), reference.pos_d, *about_down(reference[3:5], angle), reference.vel_d
            ),
            Estimate(*about_down(estimate[:2], angle), *estimate[2:]),
            KNOWN, rotation_from_quaternion(*turned_about_down(q, angle)), GAINS, 1.0, 0.02,
        )  # fmt: skip
        north, east = about_down((found.heading_north, found.heading_east), angle)
        assert other == pytest.approx(found._replace(heading_north=north, heading_east=east), abs=1e-12)


@SEEDS
def test_in_a_mirror_the_autopilot_rolls_and_yaws_the_other_way(seed):
    rng = np.random.default_rng(seed)
    reference, estimate, q = drawn(rng)
    rates = floats(rng, 3)

    def flipped(record, *names):
        return record._replace(**{name: -getattr(record, name) for name in names})

    def steered(state, reference, estimate, q, rates, gains):
        rotation = rotation_from_quaternion(*q)
        after = outer_loop(state, reference, estimate, KNOWN, rotation, gains, 1.0, 0.02)
        return inner_loop(after, rotation, *rates, gains, 0.004)

    after, lon, lat, col, ped = steered(STATE, reference, estimate, q, rates, GAINS)
    aside = ("accel_right", "gust_right", "lat", "pedal", "heading_east", "turn_rad_s", "push_right")
    other, lon_2, lat_2, col_2, ped_2 = steered(
        flipped(STATE, *aside, "roll_sine"), flipped(reference, "pos_e", "vel_e"),
        flipped(estimate, "pos_e", "v", "force_y"), (q[0], -q[1], q[2], -q[3]), (-rates[0], rates[1], -rates[2]),
        flipped(GAINS, "roll_trim_sine", "pedal_trim_rad"),
    )  # fmt: skip
    assert flipped(other, *aside, "roll_sine") == pytest.approx(after, abs=1e-12)
    assert (lon_2, -lat_2, col_2, -ped_2) == pytest.approx((lon, lat, col, ped), abs=1e-12)


def test_forward_and_to_the_right_are_flown_alike_where_gains_and_trims_are():
    """A quarter-turn: an error to the right is answered with roll as one ahead is with pitch."""
    gains = AutopilotGains(gust_share=0.4, gust_decay_forward=0.7, gust_decay_right=0.7)
    level, still = rotation_from_quaternion(1.0, 0.0, 0.0, 0.0), hovering(gains)
    for ahead, speed, force in ((0.7, 0.0, 0.0), (0.0, 0.4, 0.0), (0.0, 0.0, 0.5), (0.3, -0.2, 0.1)):
        one = outer_loop(
            still,
            Reference(ahead, 0.0, -3.0, 0.0, 0.0, 0.0),
            Estimate(0.0, 0.0, -3.0, speed, 0.0, 0.0, force, 0.0, -9.8),
            KNOWN,
            level,
            gains,
            0.0,
            0.02,
        )
        two = outer_loop(
            still,
            Reference(0.0, ahead, -3.0, 0.0, 0.0, 0.0),
            Estimate(0.0, 0.0, -3.0, 0.0, speed, 0.0, 0.0, force, -9.8),
            KNOWN,
            level,
            gains,
            0.0,
            0.02,
        )
        assert two.roll_sine == pytest.approx(-one.pitch_sine)
        assert (two.accel_right, two.gust_right) == pytest.approx((one.accel_forward, one.gust_forward))
        assert (two.pitch_sine, one.roll_sine) == pytest.approx((0.0, 0.0))


@pytest.mark.parametrize("shift_s", [0.0, 512.0, -64.0])
def test_a_path_that_begins_later_is_flown_later_and_held_at_its_ends(shift_s):
    knots = np.array([0.0, 4.0, 6.0, 11.0])
    places = np.array([[0.0, 0.0, -3.0], [2.0, -1.0, -3.0], [2.0, 1.0, -1.0], [0.0, 0.0, 0.0]])
    path = Path(knots + shift_s, places)
    for blend_s in (0.0, 1.0):
        flown = rounded(path, blend_s) if blend_s else path
        known = rounded(Path(knots, places), blend_s) if blend_s else Path(knots, places)
        for t_s in np.arange(-2.0, 14.0, 0.25):
            assert reference_at(flown, t_s + shift_s) == pytest.approx(reference_at(known, t_s), abs=1e-9)
        assert reference_at(flown, shift_s - 9.0) == pytest.approx((*places[0], 0.0, 0.0, 0.0))
        assert reference_at(flown, shift_s + 99.0) == pytest.approx((*places[-1], 0.0, 0.0, 0.0))


def test_a_rounded_corner_is_the_mean_of_the_sharp_one_over_the_blend():
    """Ahead of the corner by half the time, behind by as much; its speed is the mean of the legs' in the middle."""
    path = Path(np.array([0.0, 10.0, 20.0]), np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [10.0, 10.0, 0.0]]))
    smooth = rounded(path, 2.0)
    for t_s in (9.0, 9.5, 10.0, 10.75, 11.0):
        around = [reference_at(path, t) for t in np.linspace(t_s - 1.0, t_s + 1.0, 2001)]
        mean = np.mean([place[:2] for place in around], axis=0)
        assert reference_at(smooth, t_s)[:2] == pytest.approx(mean, abs=5e-3)


@pytest.mark.parametrize("heading", [0.0, 1.3, -2.0])
@pytest.mark.parametrize(("roll", "pitch"), [(0.1, 0.0), (-0.1, 0.0), (0.0, 0.1), (0.05, -0.08)])
def test_one_that_leans_on_nothing_but_its_own_thrust_feels_no_gust(roll, pitch, heading):
    """Thrust that carries the weight explains what is felt, to the third order of the lean; a push beside it shows."""
    rotation = rotation_from_quaternion(*quaternion_from_euler(roll, pitch, heading))
    thrust = -GRAVITY_M_S2 / rotation[8]
    leaning = Estimate(0.0, 0.0, -3.0, 0.0, 0.0, 0.0, 0.0, 0.0, thrust)
    gains = AutopilotGains()
    assert unexplained_acceleration(leaning, rotation, gains) == pytest.approx((0.0, 0.0), abs=0.01)
    pushed = unexplained_acceleration(leaning._replace(force_x=0.5, force_y=-0.3), rotation, gains)
    assert pushed == pytest.approx((0.5, -0.3), abs=0.02)
