"""What a flow sensor's file says to those who use the sensor: gains, age of a reading, and how its axes lie."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError
from flownav.sensors.datasheet import Dynamics, FlowSensor

Array = NDArray[np.float64]
UNTURNED = ((1.0, 0.0), (0.0, 1.0))


BAND_HZ = 1.0  # of the closed loop: attitude follows to 5.4 rad/s (`simulation.assemble`), velocity less far
DELAY_WITHIN_DEG = 10.0  # a delay stands for dynamics whose phase it follows so well


class IdentifiedFlow(NamedTuple):
    """Reported over true velocity of each body axis, the age of a reading, and sensor's axes = axes @ vehicle's."""

    gain_u: float
    gain_v: float
    latency_s: float
    axes: tuple[tuple[float, float], tuple[float, float]] = UNTURNED


def in_vehicle_axes(value: Array, identified: IdentifiedFlow, *, angular: bool) -> Array:
    """Readings (n, 2 or more) of a sensor that is turned or wired otherwise, in the vehicle's axes.

    A sensor's axes are the vehicle's, each with a sign and perhaps swapped, so the way back is the transpose. Angular
    flow and the sensor's own gyro (columns 2 and 3) turn as the velocity (flow_y, -flow_x) does.
    """
    back, value = np.transpose(identified.axes), value.copy()
    for x, y in ((0, 1), (2, 3)) if angular else ((0, 1),):
        if angular:
            forward, right = back @ np.array([value[:, y], -value[:, x]])
            value[:, y], value[:, x] = forward, -right
        else:
            value[:, x], value[:, y] = back @ value[:, [x, y]].T
    return value


def identified_axes(verdict: str) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """What a sensor file says of the axes, as sensor's = axes @ vehicle's; None where it does not know."""
    if "unclear" in verdict or "mirrored" in verdict.replace("not mirrored", ""):
        return None
    both = "signs of x and y" in verdict or "both signs" in verdict
    x = -1.0 if both or "sign of x" in verdict else 1.0
    y = -1.0 if both or "sign of y" in verdict else 1.0
    return ((0.0, x), (y, 0.0)) if "swapped" in verdict else ((x, 0.0), (0.0, y))


def phase_off_delay_deg(dynamics: Dynamics, band_hz: float = BAND_HZ) -> float:
    """How far the phase of G(s) = a/(s^2 + b s + c) is at most from that of its delay b/c, from 0 to band_hz [deg].

    Noise beyond the band does not matter: G is taken for what it does to motion that the vehicle makes.
    """
    w = 2.0 * np.pi * np.linspace(0.0, band_hz, 201)
    lag = np.arctan2(dynamics.b_1_s * w, dynamics.c_1_s2 - w * w)
    return float(np.degrees(np.max(np.abs(lag - dynamics.delay_s * w))))


def needs_lag_states(sensor: FlowSensor) -> bool:
    """Whether the sensor's dynamics are more than a delay over the flight's band, and were identified as such."""
    found = sensor.identification
    off = phase_off_delay_deg(sensor.dynamics) > DELAY_WITHIN_DEG
    return off and (found is None or found.dynamics.validity == "identified")


def identified_flow(sensor: FlowSensor, lag_states: bool | None = None) -> IdentifiedFlow:
    """A sensor file's axes, gains and latency; those of its dynamics where no log was identified.

    lag_states: whether the dynamics are states of the filter; by default where the sensor needs it. The latency is then
    without their delay. InputError where the file's axes are not known.
    """
    found = sensor.identification
    lag_states = needs_lag_states(sensor) if lag_states is None else lag_states
    carried_s = sensor.dynamics.delay_s if lag_states else 0.0
    if found is None:
        return IdentifiedFlow(sensor.dynamics.gain, sensor.dynamics.gain, sensor.dynamics.delay_s - carried_s)
    axes = identified_axes(found.axes)
    if axes is None:
        raise InputError(f"{sensor.name}: {found.axes}; mend the log's axes, then identify again")

    def gain_of(axis: str) -> float:
        """The axis' gain, 1 where no height's interval excludes it: an uncertain gain would do more harm than good."""
        rows = [r for r in found.responses if r.axis == axis] or list(found.responses)
        sure = any(not r.gain_low <= 1.0 <= r.gain_high for r in rows)
        return float(np.mean([r.gain for r in rows])) if sure else 1.0

    return IdentifiedFlow(gain_of("x"), gain_of("y"), max(found.latency_s - carried_s, 0.0), axes)
