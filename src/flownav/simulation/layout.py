"""Where everything a block of flights needs lies in its lane buffer: constant rows, and their access.

One flat buffer holds every scalar as a row of lanes (see `flownav.compile`). Rows are module constants, so
that kernels see them as compile-time numbers.
"""

from __future__ import annotations

from flownav.compile import lane_access
from flownav.control.autopilot import AutopilotState, Estimate
from flownav.estimation.kalman import kalman_row_count, kalman_rows
from flownav.estimation.landing.states import LANDING_ROW_COUNT, landing_rows
from flownav.estimation.paper_filter import INPUTS, STATES
from flownav.sensors.flow import FlowState
from flownav.sensors.gps_ins import GpsInsErrors, GpsInsNormals, NavSolution
from flownav.sensors.imu import ImuNormals, ImuReading, ImuState
from flownav.sensors.pad_fix import PadFixNormals, PadFixReading
from flownav.sensors.rangefinder import RangefinderState
from flownav.simulation.wind import WindNormals, WindState, WindVelocity
from flownav.vehicle.state import Controls, HelicopterState, Inflow


class _Rows:
    """Hands out consecutive rows."""

    def __init__(self) -> None:
        self.next = 0

    def take(self, count: int) -> int:
        """The first of `count` new rows."""
        first = self.next
        self.next += count
        return first


_rows = _Rows()

# the plant
HELICOPTER = _rows.take(len(HelicopterState._fields))
STAGE = _rows.take(len(HelicopterState._fields))  # the state of a Runge-Kutta stage
SUM = _rows.take(len(HelicopterState._fields))  # the weighted sum of stage rates
INFLOW = _rows.take(len(Inflow._fields))
CONTROLS = _rows.take(len(Controls._fields))
WIND = _rows.take(len(WindState._fields))
AIR = _rows.take(len(WindVelocity._fields))
THRUST = _rows.take(1)  # main rotor thrust [N]
CONTACT = _rows.take(1)  # total skid load [N]
PREVIOUS_VELOCITY = _rows.take(3)  # NED velocity one epoch ago [m/s]
PREVIOUS_ATTITUDE = _rows.take(4)  # attitude one epoch ago

# the sensors
GPS_ERRORS = _rows.take(len(GpsInsErrors._fields))
GPS_HELD = _rows.take(len(NavSolution._fields))
GPS = _rows.take(len(NavSolution._fields))  # the reading
FLOW = _rows.take(len(FlowState._fields))
RANGEFINDER = _rows.take(len(RangefinderState._fields))
FLOW_READING = _rows.take(4)  # u, v, w [m/s], and whether the sensor is engaged
FLOW_SIGMA = _rows.take(1)  # of the published flow velocity [m/s]
RANGE = _rows.take(2)  # the latest reading [m] and whether it is valid
IMU = _rows.take(len(ImuState._fields))
IMU_BIAS = IMU + ImuState._fields.index("accel_bias_x")
IMU_READING = _rows.take(len(ImuReading._fields))
PAD_READING = _rows.take(len(PadFixReading._fields))

# standard normals of the epoch: pairs in the order of drawing
GPS_NORMALS = _rows.take(len(GpsInsNormals._fields))
GPS_JITTER = GPS_NORMALS + GpsInsNormals._fields.index("jitter_n")
FLOW_NORMALS = _rows.take(4)  # u, v, w, range
WIND_NORMALS = _rows.take(len(WindNormals._fields) + len(WindNormals._fields) % 2)
IMU_NORMALS = _rows.take(len(ImuNormals._fields))
PAD_NORMALS = _rows.take(len(PadFixNormals._fields))
NORMALS_END = _rows.next

# the paper's filter: state and covariance, inputs and measurements; then the landing filter
FILTER = kalman_rows(_rows.take(kalman_row_count(STATES)), STATES)
INPUT = _rows.take(INPUTS)
MEASURED = _rows.take(STATES)
ARRIVED = _rows.take(STATES)
SCORED = STATES
INNOVATION = _rows.take(2 * STATES)  # of each component, then their variances

LANDING = landing_rows(_rows.take(LANDING_ROW_COUNT))
START_NORMALS = _rows.take(9)  # of this flight's start: position, velocity, accelerometer bias
STILL = _rows.take(1)  # 1.0 where the vehicle stands on its skids
ALWAYS = _rows.take(1)  # 1.0
NOTHING = _rows.take(1)  # 0.0

# what the filter says, whichever flies: position NED and body velocity, and their variances
ESTIMATED = _rows.take(STATES)
ESTIMATED_ATTITUDE = _rows.take(4)
VARIANCE = _rows.take(STATES)
NEES = _rows.take(1)  # of position and velocity NED; 0 where the filter does not say

# the autopilot
ESTIMATE = _rows.take(len(Estimate._fields))  # what it flies on
HOME = _rows.take(3)  # estimated position of the pad [m]
AUTOPILOT = _rows.take(len(AutopilotState._fields))

ROWS = _rows.next

load_helicopter, store_helicopter = lane_access(HelicopterState, HELICOPTER)
load_stage, store_stage = lane_access(HelicopterState, STAGE)
load_sum, store_sum = lane_access(HelicopterState, SUM)
load_inflow, store_inflow = lane_access(Inflow, INFLOW)
load_controls, store_controls = lane_access(Controls, CONTROLS)
load_wind, store_wind = lane_access(WindState, WIND)
load_air, store_air = lane_access(WindVelocity, AIR)
load_gps_errors, store_gps_errors = lane_access(GpsInsErrors, GPS_ERRORS)
load_gps_held, store_gps_held = lane_access(NavSolution, GPS_HELD)
load_gps, store_gps = lane_access(NavSolution, GPS)
load_flow, store_flow = lane_access(FlowState, FLOW)
load_rangefinder, store_rangefinder = lane_access(RangefinderState, RANGEFINDER)
load_imu, store_imu = lane_access(ImuState, IMU)
load_imu_reading, store_imu_reading = lane_access(ImuReading, IMU_READING)
load_gps_normals, _ = lane_access(GpsInsNormals, GPS_NORMALS)
load_wind_normals, _ = lane_access(WindNormals, WIND_NORMALS)
load_imu_normals, _ = lane_access(ImuNormals, IMU_NORMALS)
load_pad_normals, _ = lane_access(PadFixNormals, PAD_NORMALS)
load_pad_reading, store_pad_reading = lane_access(PadFixReading, PAD_READING)
load_estimate, store_estimate = lane_access(Estimate, ESTIMATE)
load_autopilot, store_autopilot = lane_access(AutopilotState, AUTOPILOT)
