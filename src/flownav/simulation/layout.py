"""Where everything a block of flights needs lies in its lane buffer: constant rows, and their access.

One flat buffer holds every scalar as a row of lanes (see `flownav.core.compile`). Rows are module constants, so
that kernels see them as compile-time numbers.
"""

from typing import Any

from flownav.control import learning
from flownav.control.autopilot import AutopilotState, Estimate
from flownav.control.guidance import Knowledge
from flownav.control.learning import Learnt, Stir
from flownav.control.learnt_gains import LoopGains
from flownav.core.compile import Layout, lane_access
from flownav.estimation.paper_filter import STATES, kalman_row_count, kalman_rows
from flownav.navigation.records import Reading
from flownav.sensors.flow import FlowParameters, FlowReading, FlowState
from flownav.sensors.gps_ins import GpsInsErrors, GpsInsNormals, NavSolution
from flownav.sensors.inertial import ImuReading
from flownav.sensors.range_sensor import RangefinderState, RangeReading
from flownav.simulation import records
from flownav.simulation.ground import RecirculationState
from flownav.simulation.truth import PARTS, SENSOR_TABLE, SIZES
from flownav.simulation.views import attitude_of
from flownav.simulation.wind import WindNormals, WindState
from flownav.vehicle.parameters import MultirotorParameters
from flownav.vehicle.state import Around, Controls, HelicopterState, Inflow, MultirotorState, Six


def size_of(record: Any) -> int:
    """How many rows a record takes; none where there is none."""
    return 0 if record is None else len(record._fields)


def in_pairs(record: Any) -> int:
    """How many rows the normals of a record take, which are drawn in pairs."""
    return size_of(record) + size_of(record) % 2


PLANT = _rows = Layout()
BY_CHANNEL = sorted(SENSOR_TABLE, key=lambda sensor: sensor.channels.reading)  # the order of their rows

# what this flight's vehicle, wind and sensors are (`simulation.truth`)
AS_IS = {part: _rows.take(SIZES[part]) for part in PARTS}
AS_IS_BEGIN, AS_IS_END = AS_IS["vehicle"], _rows.next

# the plant
HELICOPTER = _rows.keep(HelicopterState)  # or the multirotor, whose first fields are the same
ROTOR_SPEED = HELICOPTER + HelicopterState._fields.index("speed")
_rows.name(records.RotorSpeed, ROTOR_SPEED)
STAGE = _rows.take(len(HelicopterState._fields))  # the state of a Runge-Kutta stage
SUM = _rows.take(len(HelicopterState._fields))  # the weighted sum of stage rates
INFLOW = _rows.take(len(Inflow._fields))
CONTROLS = _rows.keep(Controls)
WIND = _rows.keep(WindState)
AROUND = _rows.keep(Around)
_rows.keep(RecirculationState)
LOADS = _rows.keep(records.Loads)
THRUST, CONTACT, POWER = LOADS, LOADS + 1, LOADS + 2
_rows.keep(records.Before)

# the sensors
_rows.keep(GpsInsErrors)
GPS_HELD = _rows.take(len(NavSolution._fields))
GPS = _rows.keep(NavSolution)  # the reading
_rows.keep(FlowState)
_rows.keep(RangefinderState)
FLOW_READING = _rows.keep(FlowReading)
SEES_FLOW = FLOW_READING + FlowReading._fields.index("engaged")
_rows.name(records.SeesFlow, SEES_FLOW)
RANGE = _rows.keep(RangeReading)

STREAM = _rows.take(1)  # of the lane's noise, from its block's first flight on; the bits of a whole number

# standard normals of the epoch: pairs in the order of drawing
START_NORMALS = _rows.next  # from here to START_END what is drawn before the first epoch
GPS_NORMALS = _rows.keep(GpsInsNormals)
GPS_JITTER = GPS_NORMALS + GpsInsNormals._fields.index("jitter_n")
FLOW_NORMALS = _rows.keep(records.FlowNormals)
WIND_NORMALS = _rows.keep(WindNormals)
NORMALS_END = _rows.next
RECIRCULATION_NORMALS = _rows.take(len(RecirculationState._fields) + len(RecirculationState._fields) % 2)
# and those of every carried unit, which become the unit as it is on this flight, and of its state
UNIT, BEGUN = {}, {}
for _one in BY_CHANNEL:
    UNIT[_one.name] = _rows.take(in_pairs(_one.unit))
    BEGUN[_one.name] = _rows.take(in_pairs(_one.begun))
START_END = _rows.next

# the paper's filter: state and covariance, inputs and measurements
FILTER = kalman_rows(_rows.take(kalman_row_count(STATES)), STATES)
_rows.name(records.PaperState, *range(FILTER.state, FILTER.state + STATES))
_rows.name(records.PaperVariance, *(FILTER.covariance + i * (STATES + 1) for i in range(STATES)))
INPUT = _rows.keep(records.PaperInput)
MEASURED = _rows.keep(records.Measured)
ARRIVED = _rows.keep(records.Arrived)
INNOVATION = _rows.take(2 * STATES)  # of each component, then their variances

# the sensors that feed the navigator: the state of each, the normals of its reading
STATE, NORMALS = {}, {}
for _one in BY_CHANNEL:
    STATE[_one.name] = _rows.take(size_of(_one.state))
    NORMALS[_one.name] = _rows.take(in_pairs(_one.normals))
_rows.keep(ImuReading)  # means over the last inertial period
_rows.keep(Knowledge)
_rows.keep(records.Felt)
_rows.keep(records.Exposed)
FAULT_NORMALS = _rows.take(6)
_rows.keep(records.HeldRange)
EARLIER_READINGS = 8
FAULT_EARLIER = _rows.take(len(Reading._fields) * EARLIER_READINGS)  # the last readings of flow
_rows.keep(records.Landed)
# what the vehicle makes of the navigator: carried on to now
_rows.keep(records.PadPlace)
_rows.keep(records.AttitudeError)
HORIZON_ERROR = _rows.keep(records.HorizonError)
# the estimate of the filter that flies
ESTIMATED = _rows.keep(records.Estimated)
_rows.keep(records.Spread)
NEES = _rows.keep(records.Nees)
# the autopilot
ESTIMATE = _rows.keep(Estimate)  # its feedback
HOME = _rows.keep(records.Home)
AUTOPILOT = _rows.keep(AutopilotState)
# what it learns of the vehicle
LOOP_GAINS = _rows.keep(LoopGains)
_rows.keep(Stir)
LEARNT = _rows.keep(Learnt)
SPECTRA = _rows.take(learning.SPECTRA)
LEARNING_SCRATCH = _rows.take(learning.SCRATCH)

ROWS = _rows.next
# behind the rows: readings on their way, a ring of slots, each with one reading of every lane. They are filled in the
# order of sampling and emptied in that of the instants that the readings describe, both known beforehand (`fitting`),
# so that no lane waits for another.
_rows.keep(Reading, 0, "slot")
load_slot, put_slot = PLANT.access(Reading)
FIELDS = len(Reading._fields)
reading_at, store_row = lane_access(Reading, None)
# and what is remembered for as long as the horizon is
_rows.anywhere(records.TruthThen, "truth_row")
load_inertial_then, _ = _rows.anywhere(records.InertialThen, "inertial_row")

_rows.name(MultirotorParameters, *range(AS_IS["vehicle"], AS_IS["vehicle"] + len(MultirotorParameters._fields)))
for _part in ("vehicle", "wind", "ground", "recirculation", "fault"):
    PLANT.name(PARTS[_part], *range(AS_IS[_part], AS_IS[_part] + SIZES[_part])[: len(PARTS[_part]._fields)])
PAPERS = Layout(below=PLANT)  # with what belongs to the paper's flow sensor alone
PAPERS.name(FlowParameters, *range(AS_IS["flow"], AS_IS["flow"] + SIZES["flow"]))
CARRIERS = Layout(below=PLANT)  # with what belongs to the sensors that a vehicle carries
CARRIERS.name(FlowParameters, *range(AS_IS["camera_flow"], AS_IS["camera_flow"] + SIZES["camera_flow"]))
CARRIERS.see(attitude_of)

load_helicopter, store_helicopter = PLANT.access(HelicopterState)
load_stage, store_stage = lane_access(HelicopterState, STAGE)
load_sum, store_sum = lane_access(HelicopterState, SUM)
load_multirotor, store_multirotor = lane_access(MultirotorState, HELICOPTER)
load_multirotor_stage, store_multirotor_stage = lane_access(MultirotorState, STAGE)
load_roots, store_roots = lane_access(Six, SUM)  # of the shares of thrust that the mixer commands
load_inflow, store_inflow = lane_access(Inflow, INFLOW)
load_controls, store_controls = PLANT.access(Controls)
load_loads, store_loads = PLANT.access(records.Loads)
load_estimated, store_estimated = PLANT.access(records.Estimated)
load_around, store_around = PLANT.access(Around)
load_recirculation, store_recirculation = PLANT.access(RecirculationState)
load_recirculation_normals, _ = lane_access(RecirculationState, RECIRCULATION_NORMALS)
load_gps_errors, store_gps_errors = PLANT.access(GpsInsErrors)
load_gps_held, store_gps_held = lane_access(NavSolution, GPS_HELD)
_, store_gps = PLANT.access(NavSolution)
load_gps_normals, _ = PLANT.access(GpsInsNormals)
load_autopilot, store_autopilot = PLANT.access(AutopilotState)
load_loop_gains, store_loop_gains = PLANT.access(LoopGains)
load_stir, store_stir = PLANT.access(Stir)
load_learnt, store_learnt = PLANT.access(Learnt)
load_felt, _ = PLANT.access(records.Felt)
vehicle_as_is, _ = lane_access(PARTS["vehicle"], AS_IS["vehicle"])  # of a multirotor its first fields only
multirotor_as_is, _ = lane_access(MultirotorParameters, AS_IS["vehicle"])
ground_as_is, _ = lane_access(PARTS["ground"], AS_IS["ground"])
recirculation_as_is, _ = lane_access(PARTS["recirculation"], AS_IS["recirculation"])
fault_as_is, _ = lane_access(PARTS["fault"], AS_IS["fault"])
