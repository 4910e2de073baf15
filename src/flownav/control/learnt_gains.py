"""The gains for a vehicle that was learnt in hover (`learning`), read out of the table in `learnt_shapes`.

The table was searched for boxes of what is then known, by stiffness and by lag. Where learning failed (too unsure,
outside the table) the gains before stay.
"""

from typing import NamedTuple

import numpy as np

from flownav.control.gains import AutopilotGains
from flownav.control.learning import EPOCH_S, Learnt
from flownav.control.learnt_shapes import LAG_NODES, PITCH_NODES, PITCH_SHAPES, POSITION_1_S, ROLL_NODES, ROLL_SHAPES
from flownav.core.compile import equation, exp, log_of_unit, procedure, replacing

LEAST_SURE = 0.05  # standard deviation of ln k and of ln lag: two of them are the half width of the table's boxes
BEYOND = 0.1  # how far outside the table's nodes, in logarithms, its ends still serve


class LoopGains(NamedTuple):
    """The gains that learning changes, as they are loops."""

    position_gain: float
    forward_gain: float
    forward_integral: float
    gust_decay_forward: float
    right_gain: float
    right_integral: float
    gust_decay_right: float
    pitch_gain: float
    pitch_integral: float
    pitch_damping: float
    roll_gain: float
    roll_integral: float
    roll_damping: float


with_loops = replacing(AutopilotGains, *LoopGains._fields)


@equation
def gains_with(gains: AutopilotGains, loops: LoopGains) -> AutopilotGains:
    """All gains as they are loops."""
    return with_loops(
        gains, position_gain=loops.position_gain, forward_gain=loops.forward_gain,
        forward_integral=loops.forward_integral, gust_decay_forward=loops.gust_decay_forward,
        right_gain=loops.right_gain, right_integral=loops.right_integral, gust_decay_right=loops.gust_decay_right,
        pitch_gain=loops.pitch_gain, pitch_integral=loops.pitch_integral, pitch_damping=loops.pitch_damping,
        roll_gain=loops.roll_gain, roll_integral=loops.roll_integral, roll_damping=loops.roll_damping,
    )  # fmt: skip


@equation
def loop_gains_of(gains: AutopilotGains) -> LoopGains:
    """The gains of the whole box."""
    return LoopGains(
        gains.position_gain, gains.forward_gain, gains.forward_integral, gains.gust_decay_forward, gains.right_gain,
        gains.right_integral, gains.gust_decay_right, gains.pitch_gain, gains.pitch_integral, gains.pitch_damping,
        gains.roll_gain, gains.roll_integral, gains.roll_damping,
    )  # fmt: skip


@equation
def place_between(value: float, nodes: "np.ndarray[tuple[int, ...], np.dtype[np.float64]]") -> tuple[int, float]:
    """Which two nodes (rising logarithms) a logarithm lies between, and how far along; held at the ends."""
    below = 0
    for k in range(1, len(nodes) - 1):
        below = k if value >= nodes[k] else below
    share = (value - nodes[below]) / (nodes[below + 1] - nodes[below])
    return below, min(1.0, max(0.0, share))


@equation
def shape_at(
    stiffness: float, lag: float, nodes: "np.ndarray[tuple[int, ...], np.dtype[np.float64]]",
    shapes: "np.ndarray[tuple[int, ...], np.dtype[np.float64]]", what: int,
) -> float:  # fmt: skip
    """One number of the table at a stiffness and a lag, in logarithms; logarithms are what the table holds."""
    k, along = place_between(stiffness, nodes)
    m, across = place_between(lag, LAG_NODES)
    short = shapes[k, m, what] * (1.0 - along) + shapes[k + 1, m, what] * along
    long = shapes[k, m + 1, what] * (1.0 - along) + shapes[k + 1, m + 1, what] * along
    return exp(short * (1.0 - across) + long * across)


@equation
def inside(value: float, nodes: "np.ndarray[tuple[int, ...], np.dtype[np.float64]]") -> bool:
    """Whether the table's ends still serve a logarithm."""
    low, high = nodes[0] - BEYOND, nodes[len(nodes) - 1] + BEYOND
    return bool(low < value < high)


@procedure
def judged(learnt: Learnt) -> Learnt:
    """The solution with its verdict."""
    pitch, roll = -log_of_unit(1.0 / learnt.pitch_stiffness_1_s2), -log_of_unit(1.0 / learnt.roll_stiffness_1_s2)
    lag = log_of_unit(learnt.lag_s)
    sure = learnt.std_pitch_stiffness < LEAST_SURE and learnt.std_roll_stiffness < LEAST_SURE
    sure = sure and learnt.std_lag < LEAST_SURE
    known = inside(pitch, PITCH_NODES) and inside(roll, ROLL_NODES) and inside(lag, LAG_NODES)
    return with_state(learnt, state=1.0 if sure and known else (-3.0 if sure else -1.0))


with_state = replacing(Learnt, "state")


@procedure
def shaped(before: LoopGains, learnt: Learnt) -> LoopGains:
    """The gains for what was learnt; those before where it was not."""
    if learnt.state != 1.0:
        return before
    pitch, roll = -log_of_unit(1.0 / learnt.pitch_stiffness_1_s2), -log_of_unit(1.0 / learnt.roll_stiffness_1_s2)
    lag, per_rate = log_of_unit(learnt.lag_s), 1.0 / learnt.flap_rate_1_s
    forward_tilt = per_rate * shape_at(pitch, lag, PITCH_NODES, PITCH_SHAPES, 0)
    right_tilt = per_rate * shape_at(roll, lag, ROLL_NODES, ROLL_SHAPES, 0)
    return LoopGains(
        POSITION_1_S,
        shape_at(pitch, lag, PITCH_NODES, PITCH_SHAPES, 3),
        shape_at(pitch, lag, PITCH_NODES, PITCH_SHAPES, 4),
        exp(-EPOCH_S / shape_at(pitch, lag, PITCH_NODES, PITCH_SHAPES, 5)),
        shape_at(roll, lag, ROLL_NODES, ROLL_SHAPES, 3),
        shape_at(roll, lag, ROLL_NODES, ROLL_SHAPES, 4),
        exp(-EPOCH_S / shape_at(roll, lag, ROLL_NODES, ROLL_SHAPES, 5)),
        forward_tilt,
        forward_tilt * shape_at(pitch, lag, PITCH_NODES, PITCH_SHAPES, 1),
        forward_tilt * shape_at(pitch, lag, PITCH_NODES, PITCH_SHAPES, 2),
        right_tilt,
        right_tilt * shape_at(roll, lag, ROLL_NODES, ROLL_SHAPES, 1),
        right_tilt * shape_at(roll, lag, ROLL_NODES, ROLL_SHAPES, 2),
    )
