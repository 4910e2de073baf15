"""Every sensor and the wind in one kernel: a flight has the same bits alone, among sixteen, and as plain Python."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from flownav.core.compile import LANES, ONE_LANE, equation, kernel, lane_access
from flownav.core.frames import rotation_from_quaternion
from flownav.sensors.datasheet import load_sensor
from flownav.sensors.flow import FlowParameters, FlowReading, FlowState, engage_flow, read_flow, start_flow, step_flow
from flownav.sensors.geometry import LensPose
from flownav.sensors.gps_ins import (
    GpsInsErrors,
    GpsInsNormals,
    GpsInsParameters,
    GpsInsState,
    NavSolution,
    start_gps_ins,
    step_gps_ins,
)
from flownav.sensors.inertial import ImuReading
from flownav.sensors.range_sensor import (
    RangefinderParameters,
    RangefinderState,
    RangeReading,
    slant_range,
    start_rangefinder,
    step_rangefinder,
)
from flownav.sensors.settings import FlowSettings, GpsInsSettings, RangefinderSettings
from flownav.simulation.wind import (
    WindNormals,
    WindParameters,
    WindSettings,
    WindState,
    WindVelocity,
    start_wind,
    step_wind,
)
from paper_imu import ImuNormals, ImuParameters, ImuSettings, ImuState, start_imu, step_imu

EPOCHS = 12


class Suite(NamedTuple):
    gps: GpsInsParameters
    flow: FlowParameters
    rangefinder: RangefinderParameters
    imu: ImuParameters
    wind: WindParameters


STATES = (GpsInsErrors, NavSolution, FlowState, RangefinderState, ImuState, WindState)
READINGS = (NavSolution, FlowReading, RangeReading, ImuReading, WindVelocity)
NORMALS = (GpsInsNormals, ImuNormals, WindNormals)
TRUTH = (NavSolution, ImuReading)

row = 0
access = []
for bundle in (*STATES, *READINGS, *NORMALS, *TRUTH):
    access.append(lane_access(bundle, row))
    row += len(bundle._fields)
FLOW_NORMALS = row  # u, v, w, range
ROWS = row + 4
(
    (load_errors, store_errors), (load_held, store_held), (load_flow, store_flow), (load_range, store_range),
    (load_imu, store_imu), (load_wind, store_wind),
    (_, store_solution), (_, store_flow_reading), (_, store_range_reading), (_, store_imu_reading), (_, store_air),
    (load_gps_normals, _), (load_imu_normals, _), (load_wind_normals, _),
    (load_truth, store_truth), (load_forces, store_forces),
) = access  # fmt: skip
READING_ROWS = range(
    sum(len(b._fields) for b in STATES), sum(len(b._fields) for b in STATES) + sum(len(b._fields) for b in READINGS)
)
NORMAL_ROWS = range(READING_ROWS.stop, READING_ROWS.stop + sum(len(b._fields) for b in NORMALS))


@equation
def start_lane(work, lanes, lane, suite):
    truth, forces = load_truth(work, lanes, lane), load_forces(work, lanes, lane)
    gps = start_gps_ins(truth, load_gps_normals(work, lanes, lane), suite.gps)
    store_errors(work, lanes, lane, gps.errors)
    store_held(work, lanes, lane, gps.held)
    store_flow(work, lanes, lane, start_flow(truth.vel_n_m_s, truth.vel_e_m_s, truth.vel_d_m_s, 9.8, suite.flow))
    store_range(work, lanes, lane, start_rangefinder(-truth.pos_d_m, 1.0, suite.rangefinder))
    store_imu(work, lanes, lane, start_imu(forces, load_imu_normals(work, lanes, lane), suite.imu))
    store_wind(work, lanes, lane, start_wind(load_wind_normals(work, lanes, lane), suite.wind))


@equation
def step_lane(work, lanes, lane, suite):
    truth, forces = load_truth(work, lanes, lane), load_forces(work, lanes, lane)
    rotation = rotation_from_quaternion(truth.qw, truth.qx, truth.qy, truth.qz)
    height = -truth.pos_d_m
    state = GpsInsState(load_errors(work, lanes, lane), load_held(work, lanes, lane))
    gps, solution = step_gps_ins(state, truth, load_gps_normals(work, lanes, lane), suite.gps)
    store_errors(work, lanes, lane, gps.errors)
    store_held(work, lanes, lane, gps.held)
    store_solution(work, lanes, lane, solution)
    n = FLOW_NORMALS
    sonar, distance = step_rangefinder(
        load_range(work, lanes, lane), height, rotation[8], work[(n + 3) * len(lanes) + lane], suite.rangefinder
    )
    store_range(work, lanes, lane, sonar)
    store_range_reading(work, lanes, lane, distance)
    flow = load_flow(work, lanes, lane)
    for _ in range(5):
        flow = step_flow(
            flow, truth.vel_n_m_s, truth.vel_e_m_s, truth.vel_d_m_s, slant_range(height, rotation[8]), 9.0, suite.flow
        )
    flow = engage_flow(flow, LensPose(truth.pos_n_m, truth.pos_e_m, height, rotation), 0.1, 0.1, 0.5, suite.flow)
    store_flow(work, lanes, lane, flow)
    reading = read_flow(
        flow, height, sonar.rate_m_s, work[n * len(lanes) + lane], work[(n + 1) * len(lanes) + lane],
        work[(n + 2) * len(lanes) + lane], suite.flow,
    )  # fmt: skip
    store_flow_reading(work, lanes, lane, reading)
    imu, inertial = step_imu(load_imu(work, lanes, lane), forces, load_imu_normals(work, lanes, lane), suite.imu)
    store_imu(work, lanes, lane, imu)
    store_imu_reading(work, lanes, lane, inertial)
    wind, air = step_wind(load_wind(work, lanes, lane), height, load_wind_normals(work, lanes, lane), suite.wind)
    store_wind(work, lanes, lane, wind)
    store_air(work, lanes, lane, air)


@kernel
def start_all(work, lanes, suite):
    for lane in range(len(lanes)):
        start_lane(work, lanes, lane, suite)


@kernel
def step_all(work, lanes, suite):
    for lane in range(len(lanes)):
        step_lane(work, lanes, lane, suite)


SUITES = {
    "midg, gusty": Suite(
        GpsInsSettings().parameters(),
        FlowSettings().parameters(load_sensor()),
        RangefinderSettings().parameters(),
        ImuSettings().parameters(),
        WindSettings(speed_20ft_m_s=6.0, from_direction_deg=30.0).parameters(),
    ),
    "white, calm, sonar": Suite(
        GpsInsSettings(model="white").parameters(),
        FlowSettings(vertical="sonar", shake=False).parameters(load_sensor()),
        RangefinderSettings(resolution_m=0.0, stuck_at_m=0.7).parameters(),
        ImuSettings().parameters(),
        WindSettings().parameters(),
    ),
}


def normals(flight: int, epoch: int) -> NDArray[np.float64]:
    return np.random.default_rng([flight, epoch]).standard_normal(ROWS)


def truth(flight: int, epoch: int) -> tuple[NavSolution, ImuReading]:
    """A motion over the pad that differs between flights and comes near the ground."""
    phase = 0.3 * epoch + flight
    c, s = np.cos(0.1 * np.sin(phase)), np.sin(0.1 * np.sin(phase))
    position = (0.2 * np.sin(phase), 0.1 * flight / 16.0, -(2.0 - 0.17 * epoch))
    velocity = (0.5 * np.cos(phase), -0.2, 0.3)
    return NavSolution(*position, *velocity, c, s, 0.0, 0.0), ImuReading(0.1, 0.2, -0.3, 0.5 * np.sin(phase), 0.1, -9.7)


def fill(work: NDArray[np.float64], width: int, first: int, epoch: int) -> None:
    for lane in range(width):
        drawn = normals(first + lane, epoch)
        for r in (*NORMAL_ROWS, *range(FLOW_NORMALS, ROWS)):
            work[r * width + lane] = drawn[r]
        solution, forces = truth(first + lane, epoch)
        lanes = (0,) * width
        store_truth(work, lanes, lane, solution)
        store_forces(work, lanes, lane, forces)


def fly(lanes: tuple[int, ...], first: int, suite: Suite, compiled: bool = True) -> NDArray[np.float64]:
    """Every reading of every epoch and lane: (EPOCHS, readings, lanes)."""
    width = len(lanes)
    work = np.zeros(ROWS * width)
    fill(work, width, first, 0)
    if compiled:
        start_all(work, lanes, suite)
    else:
        start_lane(work, lanes, 0, suite)
    out = []
    for epoch in range(EPOCHS):
        fill(work, width, first, epoch)
        if compiled:
            step_all(work, lanes, suite)
        else:
            step_lane(work, lanes, 0, suite)
        out.append(work.reshape(ROWS, width)[READING_ROWS].copy())
    return np.array(out)


@pytest.mark.parametrize("name", SUITES)
def test_a_flight_has_the_same_bits_alone_and_among_sixteen(name: str) -> None:
    suite = SUITES[name]
    together = fly(LANES, 0, suite)
    assert np.isfinite(together).all()
    assert np.ptp(together, axis=2).max() > 0.1  # the flights differ
    for flight in range(len(LANES)):
        alone = fly(ONE_LANE, flight, suite)
        assert alone[:, :, 0].tobytes() == together[:, :, flight].tobytes()


@pytest.mark.parametrize("name", SUITES)
def test_the_compiled_sensors_are_the_plain_ones(name: str) -> None:
    suite = SUITES[name]
    np.testing.assert_allclose(fly(ONE_LANE, 3, suite), fly(ONE_LANE, 3, suite, compiled=False), rtol=1e-13, atol=1e-14)
