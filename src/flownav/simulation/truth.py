"""What a flight's vehicle, wind, ground and sensors are, as against what navigator and autopilot believe.

Each flight has a `Truth` of its own, which lies in its lane's rows of the buffer. Where nothing is dispersed
(*matched*) it is what the datasheets say; of an *ensemble* it is drawn flight by flight (`simulation.ensemble`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from flownav.sensors.barometer import BarometerParameters
from flownav.sensors.beam import Ground
from flownav.sensors.flow import FlowParameters
from flownav.sensors.flow_camera import FlowCameraParameters
from flownav.sensors.gps_receiver import GpsReceiverParameters
from flownav.sensors.inertial import InertialParameters
from flownav.sensors.magnetometer import MagnetometerParameters
from flownav.sensors.pad_camera import PadCameraParameters
from flownav.sensors.range_sensor import RangeSensorParameters
from flownav.sensors.skid_switch import SkidSwitchParameters
from flownav.simulation.fault import SensorFault
from flownav.simulation.recirculation import RecirculationParameters
from flownav.simulation.wind import WindParameters
from flownav.vehicle.kinds import AnyVehicle
from flownav.vehicle.multirotor_parameters import MultirotorParameters
from flownav.vehicle.parameters import VehicleParameters

Array = NDArray[np.float64]


class Lateness(NamedTuple):
    """How much older readings are on arrival than their datasheets say [s]; negative: they are younger."""

    receiver_s: float
    flow_s: float
    range_s: float
    pad_s: float


PUNCTUAL = Lateness(0.0, 0.0, 0.0, 0.0)


class Truth(NamedTuple):
    """Every number that may differ from flight to flight; `flow` is the paper's metric sensor, `camera_flow` ours."""

    vehicle: AnyVehicle
    wind: WindParameters
    ground: Ground
    recirculation: RecirculationParameters
    flow: FlowParameters
    late: Lateness
    inertial: InertialParameters
    receiver: GpsReceiverParameters
    camera_flow: FlowParameters
    camera: FlowCameraParameters
    ranger: RangeSensorParameters
    baro: BarometerParameters
    mag: MagnetometerParameters
    pad: PadCameraParameters
    skid: SkidSwitchParameters
    fault: SensorFault


PARTS: dict[str, Any] = get_type_hints(Truth) | {"vehicle": VehicleParameters}
LARGEST_VEHICLE = max(len(VehicleParameters._fields), len(MultirotorParameters._fields))
SIZES = {part: len(kind._fields) for part, kind in PARTS.items()} | {"vehicle": LARGEST_VEHICLE}
TRUTH_ROWS = sum(SIZES.values())


def packed_truth(truths: Sequence[Truth]) -> Array:
    """The truths of a block's lanes as its buffer takes them, (TRUTH_ROWS, lanes) flattened."""
    columns = [
        [*truth.vehicle, *[0.0] * (LARGEST_VEHICLE - len(truth.vehicle)), *(x for part in truth[1:] for x in part)]
        for truth in truths
    ]
    rows = np.array(columns, np.float64).T
    if rows.shape[0] != TRUTH_ROWS:
        raise ValueError(f"a truth has {TRUTH_ROWS} numbers, not {rows.shape[0]}")
    return np.ascontiguousarray(rows).reshape(-1)
