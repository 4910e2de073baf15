"""The reasons for refusing a component, as kernels write them (`estimation.gating.Reason` in plain numbers), and the
one judge whose way every sensor's reading goes; what it means that a sensor speaks and does not serve.
"""

import numpy as np

from flownav.core.compile import equation
from flownav.core.measurement import Sensor
from flownav.estimation.gating import Reason
from flownav.navigation.records import Reading

(FUSED, INNOVATION_GATE, NO_DATA, NOT_FINITE, OUT_OF_RANGE, NO_HEIGHT, TILTED, BEFORE_START, DATUM, OUTAGE,
 DUPLICATE, LATE, STUCK, NEAR_GROUND, NOT_NEEDED, AHEAD, NO_HEADING) = map(int, Reason)  # fmt: skip
SILENT = -1  # no row for this component in this lane: there was no reading, or the filter has not started


@equation
def is_received(reading: Reading) -> bool:
    """Whether a reading is there for a memory that only watches: it arrived, has data and is not withheld."""
    return reading.arrived > 0.0 and reading.quality > 0.0 and reading.withheld == 0.0


@equation
def component_of(reading: Reading, component: int) -> tuple[float, float]:
    """A reading's value and stated variance of component 0, 1 or 2."""
    value = reading.value_0 if component == 0 else (reading.value_1 if component == 1 else reading.value_2)
    stated = reading.variance_0 if component == 0 else (reading.variance_1 if component == 1 else reading.variance_2)
    return value, stated


@equation
def usable(reading: Reading, value: float, variance: float, started: float) -> int:
    """FUSED where a reading may be offered, or the reason why not; SILENT where there is none."""
    reason = FUSED if np.isfinite(value + variance) else NOT_FINITE
    reason = NO_DATA if reading.quality == 0.0 else reason
    reason = OUTAGE if reading.withheld > 0.0 else reason
    reason = BEFORE_START if started == 0.0 else reason
    return SILENT if reading.arrived == 0.0 else reason


@equation
def usable_in_flight(reading: Reading, value: float, variance: float, started: float) -> int:
    """The reason by `usable`, or SILENT before the start, for a sensor that writes no row before the start."""
    return SILENT if started == 0.0 else usable(reading, value, variance, started)


# -- the judge ------------------------------------------------------------------------------------------------
# Usable, in reach, no mere repetition, no outlier: the first objection is the reading's reason. The gate
# (`offers.fuse_offered`) and the memory of lasting refusals follow.
@equation
def stated_or(stated: float, own: float) -> float:
    """The variance that a reading states, or where it states none the sensor's own."""
    return stated if np.isfinite(stated) else own


@equation
def objecting(reason: int, holds: bool, objection: int) -> int:
    """The reason that was found before; where that is FUSED and the objection holds, the objection."""
    return objection if reason == FUSED and holds else reason


@equation
def judged(usable_so_far: int, reach: int, repeats: bool, outlier: int) -> int:
    """The verdict on one component before its gate: the first objection, or FUSED where there is none.

    usable_so_far: by `usable`. reach: why the sensor cannot see it from here, or FUSED. repeats: the same value for so
    long that it is no news. outlier: why other evidence refuses it (a jump along another axis of one fix, a datum that
    is not found yet, a refuted source), or FUSED.
    """
    reason = reach if usable_so_far == FUSED else usable_so_far
    return objecting(objecting(reason, repeats, STUCK), True, outlier)


HORIZONTAL = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY, Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY, Sensor.POSE)
# A reading without data, or that another serves for, is no alarm; these are.
REFUSALS = (Reason.INNOVATION_GATE, Reason.NOT_FINITE, Reason.DUPLICATE, Reason.LATE, Reason.STUCK, Reason.AHEAD)
