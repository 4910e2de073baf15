"""What it means that a sensor speaks and does not serve: a fault of its times, its place, or the filter."""

from __future__ import annotations

from flownav.core.measurement import Sensor
from flownav.estimation.gating import Reason

HORIZONTAL = (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY, Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY, Sensor.POSE)
# A reading that knows nothing, or that another serves for, is no alarm; these are.
REFUSALS = (Reason.INNOVATION_GATE, Reason.NOT_FINITE, Reason.DUPLICATE, Reason.LATE, Reason.STUCK, Reason.AHEAD)
