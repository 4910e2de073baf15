"""Truth of a flight's vehicle, wind, ground and sensors, as against the belief of navigator and autopilot.

Each flight has a `Truth` of its own, which lies in its lane's rows of the buffer. Where nothing is dispersed
(*matched*) it is that of the datasheets; of an *ensemble* it is drawn flight by flight (`simulation.ensemble`). Its
sensors' fault is part of it, with size and time.
"""

from collections import namedtuple
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, get_type_hints

import numpy as np

from flownav.core.measurement import Array
from flownav.sensors.flow import FlowParameters
from flownav.sensors.geometry import Ground
from flownav.simulation.ground import RecirculationParameters
from flownav.simulation.sensor_table import sensor_rows
from flownav.simulation.wind import WindParameters
from flownav.vehicle.kinds import AnyVehicle
from flownav.vehicle.parameters import MultirotorParameters, VehicleParameters


class SensorFault(NamedTuple):
    """Which sensors a fault strikes (1), from when to when [s], and what it does; as it stands here, nothing.

    The first two values go through a matrix (flow's signs, axes, scale), get a bias, which grows by a drift per second,
    and noise; the others a bias, and the fourth to sixth noise (an accelerometer's). In the units of each value.
    """

    begins_s: float = np.inf
    ends_s: float = np.inf
    inertial: float = 0.0
    position: float = 0.0
    velocity: float = 0.0
    flow: float = 0.0
    range: float = 0.0
    others: float = 0.0  # of no own column here
    skids: float = 0.0  # the switch, as the navigator receives it; the autopilot has it by wire
    lost: float = 0.0  # 1: nothing arrives
    m_xx: float = 1.0
    m_xy: float = 0.0
    m_yx: float = 0.0
    m_yy: float = 1.0
    bias_0: float = 0.0
    bias_1: float = 0.0
    bias_2: float = 0.0
    bias_3: float = 0.0
    bias_4: float = 0.0
    bias_5: float = 0.0
    drift_0: float = 0.0
    drift_1: float = 0.0
    noise_first: float = 0.0
    noise_last: float = 0.0
    even_to: float = 0.0  # the first two values are drawn anew, evenly up to this; 0: they are not
    quality: float = np.nan  # its own statement; NaN: as ever
    held: float = 0.0  # 1: its first value is that before the fault
    always: float = np.nan  # its first value; NaN: as ever
    spike_share: float = 0.0  # of the readings whose first value is drawn anew, evenly between
    spike_low: float = 0.0
    spike_high: float = 0.0
    blank_s: float = 0.0  # no values for so long, at the start of every
    blank_every_s: float = 1.0
    late_readings: float = 0.0  # flow repeats its value of this many readings before


SOUND = SensorFault()


SENSOR_TABLE = sensor_rows()
NAMES, LATE = [one.name for one in SENSOR_TABLE], [one.name for one in SENSOR_TABLE if one.late]

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
PARTS = {part: kind for part, kind in PARTS.items() if part != "carried"} | {o.name: o.parameters for o in SENSOR_TABLE}
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
