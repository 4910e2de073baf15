"""What a flight's vehicle, wind, ground and sensors are, as against what navigator and autopilot believe.

Each flight has a `Truth` of its own, which lies in its lane's rows of the buffer. Where nothing is dispersed
(*matched*) it is what the datasheets say; of an *ensemble* it is drawn flight by flight (`simulation.ensemble`).
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from flownav.sensors.flow import FlowParameters
from flownav.sensors.geometry import Ground
from flownav.simulation.carried import carried_sensors
from flownav.simulation.fault import SensorFault
from flownav.simulation.recirculation import RecirculationParameters
from flownav.simulation.wind import WindParameters
from flownav.vehicle.kinds import AnyVehicle
from flownav.vehicle.multirotor_parameters import MultirotorParameters
from flownav.vehicle.parameters import VehicleParameters

Array = NDArray[np.float64]


CARRIED = carried_sensors()
NAMES, LATE = [one.name for one in CARRIED], [one.name for one in CARRIED if one.late]

# one of something for each carried sensor, and how much older than stated readings may be on arrival [s]
Carried: Any = namedtuple("Carried", NAMES)  # type: ignore[misc]
Lateness: Any = namedtuple("Lateness", LATE)  # type: ignore[misc]
PUNCTUAL: Any = Lateness(*([0.0] * len(LATE)))


class Truth(NamedTuple):
    """Every number that may differ from flight to flight; `flow` is the paper's metric sensor, `camera_flow` ours.

    late: a `Lateness`; carried: the coefficients of each sensor, a `Carried`.
    """

    vehicle: AnyVehicle
    wind: WindParameters
    ground: Ground
    recirculation: RecirculationParameters
    flow: FlowParameters
    late: Any
    camera_flow: FlowParameters
    fault: SensorFault
    carried: Any


PARTS: dict[str, Any] = get_type_hints(Truth) | {"vehicle": VehicleParameters, "late": Lateness}
PARTS = {part: kind for part, kind in PARTS.items() if part != "carried"} | {o.name: o.parameters for o in CARRIED}
LARGEST_VEHICLE = max(len(VehicleParameters._fields), len(MultirotorParameters._fields))
SIZES = {part: len(kind._fields) for part, kind in PARTS.items()} | {"vehicle": LARGEST_VEHICLE}
TRUTH_ROWS = sum(SIZES.values())


def packed_truth(truths: Sequence[Truth]) -> Array:
    """The truths of a block's lanes as its buffer takes them, (TRUTH_ROWS, lanes) flattened."""
    rows = np.array([list(_numbers(truth)) for truth in truths], np.float64).T
    if rows.shape[0] != TRUTH_ROWS:
        raise ValueError(f"a truth has {TRUTH_ROWS} numbers, not {rows.shape[0]}")
    return np.ascontiguousarray(rows).reshape(-1)


def _numbers(truth: Truth) -> Iterator[float]:
    """Every number of a truth in the order of PARTS; those that a vehicle has fewer than the largest are zeros."""
    yield from truth.vehicle
    yield from [0.0] * (LARGEST_VEHICLE - len(truth.vehicle))
    for part in (*truth[1:-1], *truth.carried):
        yield from part
