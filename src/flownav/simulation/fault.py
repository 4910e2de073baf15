"""A sensor's fault as numbers: what one flight's sensors do wrong, and when."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


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
    skids: float = 0.0  # the switch, as the navigator hears it; the autopilot has it by wire
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
    quality: float = np.nan  # what it says of itself; NaN: as ever
    held: float = 0.0  # 1: its first value is that before the fault
    always: float = np.nan  # its first value; NaN: as ever
    spike_share: float = 0.0  # of the readings whose first value is drawn anew, evenly between
    spike_low: float = 0.0
    spike_high: float = 0.0
    blank_s: float = 0.0  # no values for so long, at the start of every
    blank_every_s: float = 1.0
    late_readings: float = 0.0  # flow says what it said so many readings before


SOUND = SensorFault()
