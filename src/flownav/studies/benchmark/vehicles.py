"""The time that a block of flights spends on its plant, on the navigator and on the rest, for each kind of vehicle.

Then the recorded flight that replays are timed on, and steps of the filters and their parts, each in a bare loop.
"""

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.local import fly_many
from flownav.core.compile import LANES, Lanes, Work, kernel, pointer, procedure, unit
from flownav.core.frames import GRAVITY_M_S2
from flownav.core.measurement import Array
from flownav.estimation import paper_filter, states
from flownav.estimation.covariance import at, correct, expect, settle
from flownav.estimation.error_models import FilterSettings, propagate_walks
from flownav.estimation.motion import predict
from flownav.estimation.paper_filter import PaperModel, kalman_row_count, kalman_rows
from flownav.navigation.take import UNIT_SIGNATURE
from flownav.simulation import layout
from flownav.simulation.assemble import assemble
from flownav.simulation.block import Buffers
from flownav.simulation.engine import Instead, buffers_of, fly_into
from flownav.simulation.ensemble import believed
from flownav.simulation.onboard import Onboard
from flownav.simulation.plan import ATTITUDE_STEPS, PHYSICS_S, PHYSICS_STEPS, Flight
from flownav.simulation.plant import observe_vehicle, step_vehicle
from flownav.simulation.scenario import load_scenario, with_vehicle
from flownav.simulation.truth import packed_truth
from flownav.studies.benchmark import best_of
from flownav.vehicle.parameters import VehicleParameters
from flownav.vehicle.state import CALM

KINDS = ("maxi-joker-3", "quad-450")
ROUNDS = 5
CORES = os.cpu_count() or 1


class Parts(NamedTuple):
    """Processor time of one block of `len(LANES)` landings [s]; rest: sensors, wind, autopilot, history."""

    whole_s: float
    plant_s: float
    navigator_s: float

    @property
    def rest_s(self) -> float:
        """The time that is neither the plant's nor the navigator's [s]."""
        return self.whole_s - self.plant_s - self.navigator_s


def landing_of(vehicle: str) -> Flight:
    """The shipped landing, flown by a shipped vehicle on the navigator."""
    return assemble(with_vehicle(load_scenario("landing"), vehicle)).flight


def rate_of(flight: Flight, count: int) -> float:
    """Flights a second with scores, on every core."""
    return count / best_of(lambda: fly_many(flight, 1, count, threads=CORES), 2)


def parts_of(flight: Flight) -> Parts:
    """Times of a block of matched flights. The navigator's is what is saved when readings are taken by nobody."""
    buffers = buffers_of(flight, LANES, flight.plan.epochs, written=False)
    on_truth = flight._replace(plan=flight.plan._replace(fly_on_truth=True))
    return Parts(
        processor_s(lambda: fly_into(flight, 1, 0, LANES, buffers)),
        processor_s(lambda: plant_after(flight)),
        processor_s(lambda: fly_into(on_truth, 1, 0, LANES, buffers))
        - processor_s(lambda: fly_untaken(on_truth, buffers)),
    )


def processor_s(work: Callable[[], object]) -> float:
    """The shortest of several processor times of this thread [s]."""
    return best_of(work, ROUNDS, time.thread_time)


# -- parts alone ---------------------------------------------------------------------------------------------------
@procedure
def take_nothing(
    work: Work, p: Work, estimate: Work, innovation: Work, event: Work, entry: Work, state: Work, covariance: Work,
    room: NDArray[np.int64], used: NDArray[np.int64], t_s: float, sensor: int, lanes: Lanes,
) -> None:  # fmt: skip
    """Stands in place of `navigation.take.take_one`: the reading is ignored and only its time is kept."""
    work[len(lanes) - 1] = t_s


deaf_lanes = unit(take_nothing, UNIT_SIGNATURE, lanes=LANES)


def fly_untaken(flight: Flight, b: Buffers) -> None:
    """A block on the truth whose readings nobody takes."""
    fly_into(flight, 1, 0, LANES, b, None, Instead(take=deaf_lanes.address))


@kernel
def step_plants(
    buffer: NDArray[np.float64], lanes: Lanes, steps: int, rotors: tuple[int, ...] | None, onboard: Onboard | None
) -> None:
    """Take steps of physics, observed as a flight observes them; the lanes' vehicles and controls stand in rows."""
    work = pointer(buffer)
    for step in range(steps):
        step_vehicle(work, lanes, PHYSICS_S, rotors, onboard)
        if (step + 1) % PHYSICS_STEPS == 0:
            observe_vehicle(work, lanes, rotors, onboard)


def plant_after(flight: Flight) -> NDArray[np.float64]:
    """The vehicles' states, (fields, lanes), after a flight's steps from its start with the controls of its trim."""
    work = np.zeros(layout.ROWS * len(LANES))
    rows = work.reshape(-1, len(LANES))
    rows[layout.AS_IS_BEGIN : layout.AS_IS_END] = packed_truth([believed(flight)] * len(LANES)).reshape(-1, len(LANES))
    start, gains = flight.plan.start, flight.gains
    rows[layout.HELICOPTER : layout.HELICOPTER + len(start)] = np.array(start)[:, None]
    if isinstance(flight.vehicle, VehicleParameters):
        rows[layout.ROTOR_SPEED] = flight.vehicle.main_speed_rad_s
    rows[layout.AROUND : layout.AROUND + len(CALM)] = np.array(CALM)[:, None]
    controls = gains.lon_trim_rad, gains.lat_trim_rad, gains.collective_trim_rad, gains.pedal_trim_rad
    rows[layout.CONTROLS : layout.CONTROLS + len(controls)] = np.array(controls)[:, None]
    step_plants(work, LANES, flight.plan.epochs * ATTITUDE_STEPS * PHYSICS_STEPS, flight.rotors, flight.onboard)
    return rows[layout.HELICOPTER : layout.HELICOPTER + len(start)]


# -- the recorded flight that the replay is timed on -------------------------------------------------------------
FLIGHT = "quad-px4flow-outdoor"


def recorded_flight() -> Path | None:
    """The 849 s flight in the folder that FLOWNAV_DATA names, or in ../shared/data; None where neither has it."""
    roots = [os.environ.get("FLOWNAV_DATA"), Path.cwd().parent / "shared" / "data"]
    folders = [Path(root) / FLIGHT for root in roots if root]
    return next((folder for folder in folders if folder.is_dir()), None)


def replay_once(folder: Path) -> object:
    """Read the log, replay it, and bundle the record."""
    from flownav.logs.csv_folder import read_csv_folder
    from flownav.navigation.settings import NavigatorSettingsFile
    from flownav.replays.bundle import to_record
    from flownav.replays.prepare import ReplayOptions
    from flownav.replays.session import replay

    flown = replay(read_csv_folder(folder), ReplayOptions(), NavigatorSettingsFile())
    return to_record(flown, flown.scores(), ["flownav", "bench"])


def navigator_run(folder: Path) -> Callable[[], object]:
    """The navigator on the log's prepared readings, from its start to its end: what the engine does of a replay."""
    from flownav.logs.csv_folder import read_csv_folder
    from flownav.navigation.feed import equipment_of
    from flownav.navigation.loop import run, start_navigator
    from flownav.navigation.settings import NavigatorSettingsFile
    from flownav.navigation.tape import new_tape
    from flownav.replays.prepare import ReplayOptions, prepare

    settings, prepared = NavigatorSettingsFile(), prepare(read_csv_folder(folder), ReplayOptions())
    queue = prepared.queue
    equipment = equipment_of(prepared.streams, float(queue.t_s[0]), prepared.flow_gyro_is_imu, settings)
    tape = new_tape(queue)

    def once() -> object:
        tape.used[:] = 0
        running = start_navigator(equipment, settings, tape)
        run(queue, running)
        return running

    return once


SETTINGS = FilterSettings(
    accel_noise_m_s2_rt_hz=0.05, gyro_noise_rad_s_rt_hz=0.004, accel_walk_m_s2_rt_s=0.003, gyro_walk_rad_s_rt_s=1e-4,
    position_walk_m_rt_s=0.01,
    gps_slow_sigma_m=1.5, gps_slow_sigma_down_m=2.5, gps_slow_tau_s=300.0,
    gps_fast_sigma_m=0.5, gps_fast_sigma_down_m=1.0, gps_fast_tau_s=20.0,
    gps_velocity_sigma_m_s=0.1, gps_velocity_sigma_down_m_s=0.1, gps_velocity_tau_s=5.0,
    ins_tilt_sigma_rad=0.01, ins_tilt_tau_s=30.0, ins_heading_sigma_rad=0.15, ins_heading_tau_s=3e4,
    baro_walk_m_rt_s=0.1, pad_walk_m_rt_s=0.0, flow_scale_sigma=0.03,
    gate_sigma=5.0, accel_bias_limit_m_s2=0.6, gyro_bias_limit_rad_s=0.15,
)  # fmt: skip


def standing(lanes: Lanes, n: int = states.STATES) -> Array:
    """A buffer of filters that hover 5 m above the ground."""
    rows = np.zeros((states.FILTER_ROWS, len(lanes)))
    rows[states.QUATERNION] = rows[states.OFFERED] = rows[states.INNOVATION_VARIANCE] = 1.0
    rows[states.IMU + 5] = -GRAVITY_M_S2
    rows[states.STATE + states.POSITION + 2] = -5.0
    rows[states.ACCEL_NOISE : states.ACCEL_NOISE + 2] = SETTINGS.accel_noise_m_s2_rt_hz**2
    rows[states.GYRO_NOISE] = SETTINGS.gyro_noise_rad_s_rt_hz**2
    for i in range(n):
        rows[at(i, i)] = 0.01
    rows[states.OBSERVED : states.OBSERVED + 11] = np.array([10, 3, 4, 5, 6, 7, 8, 29, 2, 27, 9])[
        :, None
    ]  # as a flow rate
    rows[states.COEFFICIENT : states.COEFFICIENT + 9], rows[states.CROSS : states.CROSS + n], rows[states.NOISE] = (
        0.1,
        1e-8,
        1.0,
    )
    return rows.reshape(-1)


@kernel
def correct_often(buffer: Work, lanes: Lanes, steps: int, settings: FilterSettings) -> None:
    """State and covariance corrected."""
    work = pointer(buffer)
    for _ in range(steps):
        for lane in range(len(lanes)):
            work[states.ACCEPTED * len(lanes) + lane] = 1.0
        correct(work, lanes, states.STATES)


@kernel
def offer_nothing(buffer: Work, lanes: Lanes, steps: int, settings: FilterSettings) -> None:
    """A reading that no lane offers."""
    work = pointer(buffer)
    for lane in range(len(lanes)):
        work[states.OFFERED * len(lanes) + lane] = 0.0
    for _ in range(steps):
        expect(work, lanes, states.STATES, False)
        settle(work, lanes, states.STATES, 5.0)


@kernel
def predict_often(buffer: Work, lanes: Lanes, steps: int, settings: FilterSettings) -> None:
    """A prediction with its random walks."""
    work = pointer(buffer)
    for _ in range(steps):
        predict(work, lanes, states.STATES, 1e-4, settings)
        propagate_walks(work, lanes, 1e-4, settings)


# -- the paper's filter ------------------------------------------------------------------------------------------
FILTER = kalman_rows(0, paper_filter.STATES)
INPUT = kalman_row_count(paper_filter.STATES)
MEASURED = INPUT + paper_filter.INPUTS
ARRIVED = MEASURED + paper_filter.STATES
SEEN = ARRIVED + paper_filter.STATES
PAPER_ROWS = SEEN + 2 * paper_filter.STATES


@kernel
def run_paper_filter(work: Work, lanes: Lanes, steps: int, model: PaperModel) -> None:
    """Predict and update `steps` times with every component present; work (PAPER_ROWS * len(lanes),)."""
    for lane in range(len(lanes)):
        for component in range(paper_filter.STATES):
            work[(ARRIVED + component) * len(lanes) + lane] = 1.0
    for _ in range(steps):
        paper_filter.predict(work, lanes, FILTER, INPUT, model)
        paper_filter.update(work, lanes, FILTER, MEASURED, ARRIVED, SEEN, model)
