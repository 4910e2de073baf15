"""Each witness lies in each way, in each phase of a flight: what the navigator's protection levels are worth then.

With GPS and without it (from before the lift-off on), one sensor lies for the length of one phase and is honest before
and after. While no fault is suspected and no dead reckoning stated, no error is beyond its protection level, but for
the cases of BEYOND.
"""

from __future__ import annotations

import numpy as np
import pytest

from flownav.core.measurement import Sensor
from flownav.estimation.gating import Reason
from flownav.navigation.witnesses import witness
from lying_witnesses import LIES, PHASES, beyond, honest, lying, without_gps
from navigation_streams import navigate

HONEST = honest()
FLIGHTS = {"with GPS": HONEST, "without GPS": without_gps(HONEST)}
CASES = [(flight, sensor) for flight, flown in FLIGHTS.items() for sensor in flown.streams]
ANY_READING = {
    Reason.FUSED, Reason.INNOVATION_GATE, Reason.NO_DATA, Reason.NOT_FINITE, Reason.BEFORE_START, Reason.OUTAGE,
    Reason.DUPLICATE, Reason.LATE, Reason.AHEAD,
}  # fmt: skip
# Known: the greatest error without a warning, in protection levels. A GPS velocity that sticks or is reversed is
# followed before it is suspected, and so is a flow without GPS; an IMU that is reversed, or shakes beyond its sheet,
# leads height or position away for a moment.
BEYOND = {
    ("with GPS", "GPS_VELOCITY", "stuck", "flight"): 1.50, ("with GPS", "GPS_VELOCITY", "sign", "flight"): 3.51,
    ("without GPS", "FLOW_RATE", "bias", "standing, motors off"): 1.15,
    ("without GPS", "IMU", "sign", "lift-off"): 1.49, ("without GPS", "IMU", "sign", "flight"): 1.15,
    ("without GPS", "IMU", "noise", "lift-off"): 1.71,
    ("without GPS", "FLOW_RATE", "stuck", "flight"): 1.93, ("without GPS", "FLOW_RATE", "sign", "flight"): 1.43,
}  # fmt: skip


@pytest.mark.parametrize("flight", FLIGHTS)
def test_a_flight_on_which_nobody_lies_is_within_its_levels_and_suspects_nobody(flight):
    flown = navigate(FLIGHTS[flight])
    assert max(beyond(flown)) < 0.3
    assert len(flown.events("filter", "suspects")) == 0
    assert np.isfinite(flown.estimate_rows.protection_m[-1]).all()


@pytest.mark.slow
@pytest.mark.parametrize(("flight", "sensor"), CASES, ids=lambda value: getattr(value, "name", value))
def test_no_witness_that_lies_alone_leads_the_estimate_beyond_its_levels_without_a_warning(flight, sensor):
    found = {}
    for lie in LIES:
        for phase in PHASES:
            flown = navigate(lying(FLIGHTS[flight], sensor, lie, phase))
            ratio = max(beyond(flown))
            if ratio > 1.0:
                found[flight, sensor.name, lie, phase] = ratio
            check_reasons(flown, sensor)
    known = {
        case: pytest.approx(ratio, abs=0.02) for case, ratio in BEYOND.items() if case[:2] == (flight, sensor.name)
    }
    assert found == known


def check_reasons(flown, sensor: Sensor) -> None:
    """Nothing is refused for a reason that the witness's row does not name."""
    if sensor == Sensor.IMU:
        return
    row = witness(sensor)
    allowed = ANY_READING | {*row.limits, *row.outliers} | ({Reason.STUCK} if row.repeats else set())
    assert set(flown.reasons(sensor)) <= {reason.label for reason in allowed}
