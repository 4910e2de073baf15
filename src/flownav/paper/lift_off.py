"""Figure 28: the error in w about lift-off of many take-offs, as flown and with a sensor that does not shake."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from flownav.core.measurement import Array
from flownav.scoring.percentiles import spread
from flownav.simulation.engine import fly_blocks
from flownav.simulation.history import column
from flownav.simulation.plan import Flight
from flownav.simulation.sensing import EPOCH_S

REACH_S = (-1.0, 3.0)  # about lift-off: where its transient is
FLIGHTS = 96


class LiftOff(NamedTuple):
    """Largest error in w about lift-off [m/s], a row a flight: as flown, and the same flights without shake."""

    shaken_m_s: Array
    unshaken_m_s: Array

    @property
    def frozen_inflow_share(self) -> Array:
        """What the sensor's shake has no part in: the frozen inflow of B_red."""
        return self.unshaken_m_s / self.shaken_m_s

    def as_json(self) -> dict[str, Any]:
        """Median, 5th and 95th percentile of each."""
        return {
            "flights": len(self.shaken_m_s),
            "shaken_m_s": spread(self.shaken_m_s),
            "unshaken_m_s": spread(self.unshaken_m_s),
            "frozen_inflow_share": spread(self.frozen_inflow_share),
        }


def lift_offs(shaken: Flight, unshaken: Flight, seed: int, flights: int) -> LiftOff | None:
    """The first flights of a seed on both sensors, FLIGHTS of them at most; None where nothing lifts off."""
    if not shaken.plan.starts_on_ground:
        return None
    count = min(flights, FLIGHTS)
    both = (
        np.concatenate([block for _, block in fly_blocks(flight, seed, 0, count, largest_w_errors)])
        for flight in (shaken, unshaken)
    )
    return LiftOff(*both)


def largest_w_errors(history: Array) -> Array:
    """Largest absolute error in w within REACH_S of each lane's first lift-off [m/s], (lanes,)."""
    error = np.abs(history[:, column("estimate", "vel_w_m_s")] - history[:, column("truth", "vel_w_m_s")])
    lifted = np.argmax(history[:, column("truth", "contact_n")] <= 0.0, axis=0)
    before, after = (round(reach_s / EPOCH_S) for reach_s in REACH_S)
    steps = np.arange(len(error))[:, None] - lifted
    return np.asarray(np.where((steps >= before) & (steps <= after), error, 0.0).max(axis=0))
