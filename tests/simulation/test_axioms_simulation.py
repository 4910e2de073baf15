"""Invariances of a flight's surroundings and timetable: north, scale, nothing at all, and time."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from flownav.sensors.geometry import LEVEL, Ground
from flownav.simulation.fitting import Timing, clocks, sampled_readings, schedule_of
from flownav.simulation.ground import RecirculationSettings, RecirculationState, recirculated, share_beyond, under_rotor
from flownav.simulation.onboard import EPOCH_S, Clock
from flownav.simulation.truth import SENSOR_TABLE
from flownav.simulation.wind import WindNormals, WindSettings, WindState, WindVelocity, start_wind, step_wind

SEEDS = pytest.mark.parametrize("seed", range(6))


def floats(rng: np.random.Generator, count: int, size: float = 1.0) -> tuple[float, ...]:
    return tuple(float(x) for x in size * rng.normal(size=count))


def about_down(pair, angle):
    cosine, sine = math.cos(angle), math.sin(angle)
    return cosine * pair[0] - sine * pair[1], sine * pair[0] + cosine * pair[1]


@SEEDS
def test_wind_that_comes_from_elsewhere_is_the_same_wind_turned(seed):
    """Gusts, their gradients and the steady part: the same normals, the same flight, seen from another north."""
    rng = np.random.default_rng(seed)
    first, steps = WindNormals(*floats(rng, 6)), [WindNormals(*floats(rng, 6)) for _ in range(20)]
    angle_deg = float(rng.uniform(-180.0, 180.0))

    def blown(from_deg: float) -> list[WindVelocity]:
        p = WindSettings(speed_20ft_m_s=6.0, from_direction_deg=from_deg).parameters(0.7)
        state, found = start_wind(first, p), []
        for n in steps:
            state, wind = step_wind(state, 2.0, n, p)
            found.append(wind)
        return found

    for here, there in zip(blown(30.0), blown(30.0 + angle_deg - 360.0 * (angle_deg > 150.0)), strict=True):
        angle = math.radians(angle_deg)
        assert there[:2] == pytest.approx(about_down(here[:2], angle), abs=1e-9)
        assert there[3:5] == pytest.approx(about_down(here[3:5], angle), abs=1e-9)
        assert (there[2], there[5]) == pytest.approx((here[2], here[5]))


@SEEDS
def test_in_a_mirror_gusts_come_from_the_other_side(seed):
    """Right and left exchanged: gusts across, what rolls and what yaws the air have the other sign."""
    rng = np.random.default_rng(seed)
    p = WindSettings(speed_20ft_m_s=6.0, from_direction_deg=180.0).parameters(0.7)
    state, normals = WindState(*floats(rng, 8)), WindNormals(*floats(rng, 6))
    flipped = {"across1", "across2", "roll", "across_slow"}

    def mirrored(record):
        return type(record)(*(-v if name in flipped else v for name, v in record._asdict().items()))

    _, wind = step_wind(state, 2.0, normals, p)
    _, other = step_wind(mirrored(state), 2.0, mirrored(normals), p)
    signs = (1.0, -1.0, 1.0, -1.0, 1.0, -1.0)
    assert other == pytest.approx([sign * value for sign, value in zip(signs, wind, strict=True)], abs=1e-12)


def test_the_air_s_turning_is_the_slope_of_a_gust_that_is_carried_along():
    """A field v(x - V t): where the gust across grows with time, the air ahead, which is older news, has less of it."""
    p = WindSettings(speed_20ft_m_s=6.0, from_direction_deg=180.0).parameters(0.7)  # blows north
    calm = WindState(*[0.0] * 8)
    quiet = WindNormals(*[0.0] * 6)
    grows_across = calm._replace(across1=1.0, across_slow=0.2)
    grows_down = calm._replace(down1=1.0, down_slow=0.2)
    assert step_wind(grows_across, 3.0, quiet, p)[1].turn_d_rad_s < 0.0  # v = v0 + r x falls off northwards
    assert step_wind(grows_down, 3.0, quiet, p)[1].turn_e_rad_s > 0.0  # w = w0 - q x does, too


@SEEDS
def test_a_wake_comes_back_alike_from_any_side_and_without_thrust_not_at_all(seed):
    rng = np.random.default_rng(seed)
    p = RecirculationSettings().parameters(1.78, 0.3, 1.225, 3.5)
    wind, state = WindVelocity(*floats(rng, 6)), RecirculationState(*floats(rng, 3))
    angle = float(rng.uniform(-3.0, 3.0))
    turned = WindVelocity(*about_down(wind[:2], angle), *wind[2:])
    here, there = (recirculated(w, state, 0.5, 80.0, p) for w in (wind, turned))
    assert there[2:] == pytest.approx(here[2:])
    assert here[:2] == wind[:2]
    assert recirculated(wind, state, 0.5, 0.0, p) == wind
    assert recirculated(wind, state, p.diameter_m, 80.0, p) == wind


@SEEDS
def test_a_rotor_finds_the_ground_of_a_turned_world_and_of_a_larger_one(seed):
    rng = np.random.default_rng(seed)
    place, edge, toward = floats(rng, 2, 0.3), floats(rng, 2, 0.3), about_down((1.0, 0.0), float(rng.normal()))
    for step_m in (0.3, -0.4):

        def found(angle: float, size: float, step_m: float = step_m) -> float:
            here, there = (about_down(np.multiply(pair, size), angle) for pair in (place, edge))
            ground = Ground(0.0, 0.0, step_m * size, *there, *about_down(toward, angle))
            return under_rotor(*here, 1.2 * size, 0.9 * size, ground) / size

        assert found(1.3, 1.0) == pytest.approx(found(0.0, 1.0))
        assert found(0.0, 9.0) == pytest.approx(found(0.0, 1.0))


@pytest.mark.parametrize("step_m", [0.3, -0.4, -3.0])
def test_far_beyond_an_edge_a_rotor_finds_the_step_and_far_before_it_nothing(step_m):
    ground = Ground(0.0, 0.0, step_m, 0.0, 0.0, 1.0, 0.0)
    assert share_beyond(-5.0, 0.0, 0.9, ground) == pytest.approx(0.0, abs=1e-12)
    assert under_rotor(-5.0, 0.0, 2.0, 0.9, ground) == pytest.approx(0.0, abs=1e-12)
    assert under_rotor(5.0, 0.0, 2.0, 0.9, ground) == pytest.approx(step_m)
    halfway = under_rotor(0.0, 0.0, 2.0, 0.9, ground)
    assert min(0.0, step_m) < halfway < max(0.0, step_m)
    assert under_rotor(0.0, 0.0, 2.0, 0.9, LEVEL) == 0.0


# -- the timetable -------------------------------------------------------------------------------------------------
ONBOARD = SimpleNamespace(
    carried=SimpleNamespace(**{sensor.name: SimpleNamespace(clock=Clock(9, 5, 2)) for sensor in SENSOR_TABLE}),
    inertial_steps=2,
)
KINDS = {kind for kind, _, _ in clocks(ONBOARD)}  # type: ignore[arg-type]


def timed(lag_s: float, latency_s: float, jitter_s: float = 0.0) -> dict:
    return dict.fromkeys(KINDS, Timing(lag_s, latency_s, jitter_s))


@pytest.mark.parametrize("true", [(0.03, 0.05), (0.0, 0.2), (0.01, 0.0)])
@pytest.mark.parametrize("stated", [(0.03, 0.05), (0.0, 0.0), (0.1, 0.02)])
def test_a_reading_is_of_when_it_came_less_the_age_that_is_stated(true, stated):
    """Whatever nobody knows of its latency makes it seem as much younger; the order in which it is taken follows."""
    t_s, kind, epoch = sampled_readings(200, ONBOARD, timed(*true), timed(*stated))  # type: ignore[arg-type]
    other = np.isin(kind, list(KINDS))
    arrival_s = epoch[other] * EPOCH_S + true[1]
    np.testing.assert_allclose(t_s[other], arrival_s - sum(stated), atol=1e-12)
    taken = schedule_of(200, ONBOARD, timed(*true), timed(*stated))  # type: ignore[arg-type]
    assert (np.diff(taken.t_s) >= 0.0).all()
    mine = np.isin(taken.sensor, list(KINDS))
    came_s = taken.t_s[mine] + sum(stated)
    assert (taken.epoch[mine] * EPOCH_S >= came_s - 1e-9).all()  # nothing is taken before it has come
    assert taken.horizon_s >= max(sum(true), sum(stated)) - 1e-9


def test_arrivals_are_uneven_by_the_jitter_and_each_sensor_s_are_its_own():
    even, _, _ = sampled_readings(200, ONBOARD, timed(0.0, 0.05), timed(0.0, 0.05))  # type: ignore[arg-type]
    uneven, kind, _ = sampled_readings(200, ONBOARD, timed(0.0, 0.05, 0.004), timed(0.0, 0.05))  # type: ignore[arg-type]
    off = (uneven - even)[np.isin(kind, list(KINDS))]
    assert abs(off).max() <= 0.004
    assert abs(off).max() > 0.003
    assert abs(off.mean()) < 0.001
