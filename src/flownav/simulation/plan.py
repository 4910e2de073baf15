"""Description of a flight: the plan, the vehicle, the sensors and the rates of the loop, as numbers that kernels
take.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.control.gains import AutopilotGains
from flownav.control.guidance import Path
from flownav.control.learnt_model import NominalModel
from flownav.estimation.paper_filter import PaperModel
from flownav.sensors.geometry import Ground
from flownav.simulation.ground import RecirculationParameters
from flownav.simulation.navigating import Timetable
from flownav.simulation.onboard import Onboard
from flownav.simulation.plant import LinearTruth
from flownav.simulation.sensing import EPOCH_S, Draws, SensorSuite
from flownav.simulation.wind import WindParameters
from flownav.vehicle.kinds import AnyState, AnyVehicle
from flownav.vehicle.parameters import TouchdownLimits

ATTITUDE_STEPS = 5  # 250 Hz within an epoch
PHYSICS_STEPS = 2  # 500 Hz within an attitude step
ATTITUDE_S = EPOCH_S / ATTITUDE_STEPS
PHYSICS_S = ATTITUDE_S / PHYSICS_STEPS
SLOW = 0.4  # of a servo's frequency on a failing supply: chosen
CONTACT_SHARE = 0.05  # of the weight on the skids counts as touching (a skid switch): chosen, not measured
START_STEP = 1 << 40  # the noise counter's step for the draws before the first epoch
NOTHING = np.zeros(0)


class Happens(NamedTuple):
    """When what befalls the vehicle [s since the start]; `NEVER_S`: it does not."""

    engine_cut_s: float  # from then on the engine gives nothing
    tail_stuck_s: float  # the tail rotor's blades stay as they are
    servos_slow_s: float  # the cyclic's servos have SLOW of their frequency
    motor_out_s: float  # a multirotor's first motor gives nothing


class FlightPlan(NamedTuple):
    """A scenario's demands on the loop, as numbers that the kernel takes."""

    epochs: int
    start: AnyState
    starts_on_ground: bool
    takeoff_at_s: float
    may_land_after_s: float
    fly_on_truth: bool
    along_truth: bool  # the navigator's Jacobians are taken on the truth: its covariance is the bound
    minds_faults: bool  # a suspected fault is a reason to go around: the navigator follows what faults would do
    home_at_start: bool  # the pad is where the estimate first puts the start, else at the filter's origin
    start_known: bool  # the paper's filter starts at the true position, else at the first GPS reading
    handover_s: float  # until then the autopilot uses the truth, where it does not stand on its skids
    happens: Happens
    draws: Draws


class OwnParts(NamedTuple):
    """Addresses of C functions that fly in place of ours on one lane, each called with the lane buffer; 0: ours flies.

    step: the vehicle, (work, dt [s]) moves it and reports its thrust, ground load and power; dt 0 is the start. steer:
    the attitude loop, (work) sets the controls of the next ATTITUDE_S.
    """

    step: int
    steer: int


class Flight(NamedTuple):
    """Everything constant over a flight: the paper's filter, or the navigator's sensors and their timetable.

    linear: only for that truth. limits: what its touchdown is judged by.
    """

    plan: FlightPlan
    vehicle: AnyVehicle
    rotors: tuple[int, ...] | None  # a multirotor's; None: a helicopter
    sensors: SensorSuite
    wind: WindParameters
    ground: Ground
    recirculation: RecirculationParameters
    path: Path
    gains: AutopilotGains
    paper: PaperModel | None
    onboard: Onboard | None
    table: Timetable | None
    settings: NDArray[np.float64]  # the navigator's, packed; of no length where the paper's filter flies
    initial_variance: NDArray[np.float64]
    linear: LinearTruth | None
    limits: TouchdownLimits
    fails: bool | None = None  # its sensors may fail, each lane's as its truth has it; None: the code is not compiled
    learns: NominalModel | None = (
        None  # what is believed of a vehicle that may be learnt in hover; None: it is not compiled
    )
    own: OwnParts | None = None  # a user's own vehicle and controller (room parts/)
