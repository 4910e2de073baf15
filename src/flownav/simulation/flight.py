"""The closed loop: plant, sensors, filter and autopilot, a block of flights side by side.

`fly_block` is the one entry point: a block of one lane is a single flight, a block of `LANES` a slice of a
batch, and both are the same bytes. Rates: physics 500 Hz (Runge-Kutta), flow dynamics and attitude loop
250 Hz, sensors, filter and outer loop 50 Hz, rangefinder 10 Hz.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.compile import equation, kernel, pointer
from flownav.control.autopilot import (
    AutopilotGains,
    AutopilotState,
    Estimate,
    grounded,
    hovering,
    inner_loop,
    landing_logic,
    outer_loop,
)
from flownav.control.guidance import Path, Reference, reference_at
from flownav.estimation.kalman import Lanes, Work
from flownav.estimation.paper_filter import PaperModel
from flownav.frames import GRAVITY_M_S2, rotation_from_quaternion
from flownav.sensors.flow import step_flow
from flownav.sensors.gps_ins import attitude_with_error
from flownav.sensors.rangefinder import slant_range
from flownav.simulation import layout
from flownav.simulation.filtering import run_filter, start_filter
from flownav.simulation.history import write_history
from flownav.simulation.landing_filtering import LandingSetup
from flownav.simulation.layout import (
    load_autopilot,
    load_estimate,
    load_flow,
    load_gps,
    load_gps_errors,
    load_helicopter,
    load_wind,
    load_wind_normals,
    store_air,
    store_autopilot,
    store_controls,
    store_flow,
    store_helicopter,
    store_wind,
)
from flownav.simulation.plant import LinearTruth, linear_step, observe_plant, runge_kutta_step
from flownav.simulation.sensing import (
    EPOCH_S,
    Draws,
    SensorSuite,
    draw_epoch,
    lens_height,
    sense,
    start_sensors,
)
from flownav.simulation.wind import WindParameters, start_wind, step_wind
from flownav.vehicle.parameters import VehicleParameters
from flownav.vehicle.state import Controls, HelicopterState

ATTITUDE_STEPS = 5  # 250 Hz within an epoch
PHYSICS_STEPS = 2  # 500 Hz within an attitude step
ATTITUDE_S = EPOCH_S / ATTITUDE_STEPS
PHYSICS_S = ATTITUDE_S / PHYSICS_STEPS
CONTACT_SHARE = 0.05  # of the weight on the skids counts as touching (a skid switch)
START_STEP = 1 << 40  # the noise counter's step for the draws before the first epoch


class FlightPlan(NamedTuple):
    """What a scenario asks of the loop, as numbers the kernel takes."""

    epochs: int
    start: HelicopterState
    starts_on_ground: bool
    takeoff_at_s: float
    may_land_after_s: float
    fly_on_truth: bool
    home_at_start: bool  # the pad is where the estimate first puts the start, else at the filter's origin
    start_known: bool  # the filter starts at the true position, else at the first GPS reading
    draws: Draws


class Flight(NamedTuple):
    """Everything constant over a flight: one of `paper` and `landing`; `linear` only for that truth."""

    plan: FlightPlan
    vehicle: VehicleParameters
    sensors: SensorSuite
    wind: WindParameters
    path: Path
    gains: AutopilotGains
    paper: PaperModel | None
    landing: LandingSetup | None
    initial_variance: NDArray[np.float64]
    linear: LinearTruth | None


# -- start ------------------------------------------------------------------------------------------------
@equation
def start_block(work: Work, lanes: Lanes, seed: int, first: int, flight: Flight) -> None:
    """Vehicle, wind, sensors, autopilot and filter before the first epoch."""
    for group in range(3):
        draw_epoch(work, lanes, seed, first, START_STEP + 2 - group, flight.plan.draws)
        for i in range(3):
            for lane in range(len(lanes)):
                normal = work[(layout.FLOW_NORMALS + i) * len(lanes) + lane]
                work[(layout.START_NORMALS + 3 * group + i) * len(lanes) + lane] = normal
    for lane in range(len(lanes)):
        store_helicopter(work, lanes, lane, flight.plan.start)
        store_wind(work, lanes, lane, start_wind(load_wind_normals(work, lanes, lane), flight.wind))
        autopilot = grounded(flight.gains) if flight.plan.starts_on_ground else hovering(flight.gains)
        store_autopilot(work, lanes, lane, autopilot)
    observe_plant(work, lanes, flight.vehicle)
    start_sensors(work, lanes, flight.sensors, flight.vehicle.mass_kg, flight.vehicle.gravity_m_s2)


# -- one epoch --------------------------------------------------------------------------------------------
@equation
def blow(work: Work, lanes: Lanes, wind: WindParameters) -> None:
    """The wind of this epoch."""
    for lane in range(len(lanes)):
        height = -work[(layout.HELICOPTER + 2) * len(lanes) + lane]
        after, air = step_wind(load_wind(work, lanes, lane), height, load_wind_normals(work, lanes, lane), wind)
        store_wind(work, lanes, lane, after)
        store_air(work, lanes, lane, air)


@equation
def estimate_for_autopilot(work: Work, lanes: Lanes, flight: Flight) -> None:
    """What the outer loop flies on: the filter's estimate or the truth."""
    source = layout.HELICOPTER if flight.plan.fly_on_truth else layout.ESTIMATED
    for component in range(6):
        for lane in range(len(lanes)):
            value = work[(source + component) * len(lanes) + lane]
            work[(layout.ESTIMATE + component) * len(lanes) + lane] = value


@equation
def note_home(work: Work, lanes: Lanes, epoch: int, reference: Reference, flight: Flight) -> None:
    """Where the estimate puts the pad: noted at the start and for as long as the skids stay on it before take-off."""
    for lane in range(len(lanes)):
        parked = epoch * EPOCH_S < flight.plan.takeoff_at_s and flight.plan.starts_on_ground
        waiting = flight.plan.home_at_start and (epoch == 0 or parked)
        estimate = load_estimate(work, lanes, lane)
        home_n, home_e, home_d = (
            estimate.pos_n - reference.pos_n,
            estimate.pos_e - reference.pos_e,
            estimate.pos_d - reference.pos_d,
        )
        row = layout.HOME
        work[row * len(lanes) + lane] = home_n if waiting else work[row * len(lanes) + lane]
        work[(row + 1) * len(lanes) + lane] = home_e if waiting else work[(row + 1) * len(lanes) + lane]
        work[(row + 2) * len(lanes) + lane] = home_d if waiting else work[(row + 2) * len(lanes) + lane]


@equation
def command(work: Work, lanes: Lanes, t_s: float, reference: Reference, flight: Flight) -> None:
    """Landing logic and outer loop; the filter's inputs for the coming epoch."""
    plan, gains = flight.plan, flight.gains
    may_fly = 1.0 if t_s >= plan.takeoff_at_s else 0.0
    may_land = 1.0 if t_s >= plan.may_land_after_s else 0.0
    threshold = CONTACT_SHARE * flight.vehicle.mass_kg * flight.vehicle.gravity_m_s2
    for lane in range(len(lanes)):
        gps = load_gps(work, lanes, lane)
        rotation = rotation_from_quaternion(gps.qw, gps.qx, gps.qy, gps.qz)
        estimate = load_estimate(work, lanes, lane)
        relative = Estimate(
            estimate.pos_n - work[layout.HOME * len(lanes) + lane],
            estimate.pos_e - work[(layout.HOME + 1) * len(lanes) + lane],
            estimate.pos_d - work[(layout.HOME + 2) * len(lanes) + lane],
            estimate.u,
            estimate.v,
            estimate.w,
        )
        contact = work[layout.CONTACT * len(lanes) + lane]
        state = landing_logic(load_autopilot(work, lanes, lane), contact, threshold, may_fly, may_land, EPOCH_S)
        store_autopilot(work, lanes, lane, outer_loop(state, reference, relative, rotation, gains, EPOCH_S))


@equation
def note_inputs(work: Work, lanes: Lanes, gains: AutopilotGains) -> None:
    """U of the paper's filter: collective and pedal as perturbations from trim; zero where the skids touch."""
    for lane in range(len(lanes)):
        autopilot = load_autopilot(work, lanes, lane)
        flying = autopilot.flying > 0.0 and autopilot.contact_time_s == 0.0
        col = work[(layout.CONTROLS + 2) * len(lanes) + lane] - gains.collective_trim_rad
        ped = work[(layout.CONTROLS + 3) * len(lanes) + lane] - gains.pedal_trim_rad
        work[layout.INPUT * len(lanes) + lane] = 0.0
        work[(layout.INPUT + 1) * len(lanes) + lane] = 0.0
        work[(layout.INPUT + 2) * len(lanes) + lane] = col if flying else 0.0
        work[(layout.INPUT + 3) * len(lanes) + lane] = ped if flying else 0.0


@equation
def steer(work: Work, lanes: Lanes, flight: Flight, linear: LinearTruth | None) -> None:
    """The attitude loop: blade angles for the next 4 ms, on the INS attitude and the flybarless unit's gyros."""
    for lane in range(len(lanes)):
        state = load_helicopter(work, lanes, lane)
        error = load_gps_errors(work, lanes, lane)
        qw, qx, qy, qz = attitude_with_error(
            (state.qw, state.qx, state.qy, state.qz), error.roll_rad, error.pitch_rad, error.heading_rad
        )
        rotation = rotation_from_quaternion(qw, qx, qy, qz)
        after, lon, lat, col, ped = inner_loop(
            load_autopilot(work, lanes, lane), rotation, state.p, state.q, state.r, flight.gains, ATTITUDE_S
        )
        store_autopilot(work, lanes, lane, after)
        if linear is None:
            store_controls(work, lanes, lane, Controls(lon, lat, col, ped))
        else:
            store_controls(work, lanes, lane, Controls(lon, lat, col, pedal_sideways(after, flight.gains, linear)))


@equation
def pedal_sideways(state: AutopilotState, gains: AutopilotGains, linear: LinearTruth) -> float:
    """B_red answers to collective and pedal alone, so the pedal carries the lateral loop of the linear truth."""
    return gains.pedal_trim_rad + GRAVITY_M_S2 * (state.roll_sine - gains.roll_trim_sine) / linear.lateral_per_pedal


@equation
def follow_flow(work: Work, lanes: Lanes, flight: Flight) -> None:
    """The flow sensor's own dynamics, 4 ms on."""
    for lane in range(len(lanes)):
        state = load_helicopter(work, lanes, lane)
        cosine = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)[8]
        distance = slant_range(lens_height(state, cosine, flight.sensors.lens_below_cg_m), cosine)
        thrust = work[layout.THRUST * len(lanes) + lane] / flight.vehicle.mass_kg
        before = load_flow(work, lanes, lane)
        after = step_flow(before, state.u, state.v, state.w, distance, thrust, flight.sensors.flow)
        store_flow(work, lanes, lane, after)


@equation
def advance(work: Work, lanes: Lanes, flight: Flight, linear: LinearTruth | None) -> None:
    """From one epoch to the next."""
    for _ in range(ATTITUDE_STEPS):
        steer(work, lanes, flight, linear)
        follow_flow(work, lanes, flight)
        if linear is None:
            for _ in range(PHYSICS_STEPS):
                runge_kutta_step(work, lanes, flight.vehicle, PHYSICS_S)
            observe_plant(work, lanes, flight.vehicle)
        else:
            linear_step(work, lanes, linear)


@kernel
def fly_block(flight: Flight, seed: int, first: int, lanes: Lanes, work: Work, history: NDArray[np.float64]) -> None:
    """Fly `len(lanes)` flights, numbers `first` and up, of a campaign `seed`.

    work (ROWS * len(lanes),) is scratch, zeroed here; history (epochs, len(HISTORY), len(lanes)) is filled.
    """
    work[:] = 0.0
    work = pointer(work)
    start_block(work, lanes, seed, first, flight)
    for epoch in range(flight.plan.epochs):
        t_s = epoch * EPOCH_S
        reference = reference_at(flight.path, t_s)
        draw_epoch(work, lanes, seed, first, epoch, flight.plan.draws)
        blow(work, lanes, flight.wind)
        sense(work, lanes, epoch, flight.sensors, flight.vehicle.gravity_m_s2)
        if epoch == 0:
            start_filter(work, lanes, flight.initial_variance, flight.plan.start_known, flight.landing)
        run_filter(work, lanes, epoch, flight.paper, flight.landing)
        estimate_for_autopilot(work, lanes, flight)
        note_home(work, lanes, epoch, reference, flight)
        command(work, lanes, t_s, reference, flight)
        write_history(work, lanes, epoch, reference, history)
        advance(work, lanes, flight, flight.linear)
        note_inputs(work, lanes, flight.gains)
