"""A receiver whose place walks off while its own velocity and the flow show that the vehicle does not go there.

Innovations of a filter whose model holds are white. Those of a place that walks are alike: the position takes a part of
each, however slowly it walks, and no gate refuses them. Two witnesses of the velocity contradict it then, the
receiver's own and the flow. So its place is held back for a moment: one that walks on leaves its gate meanwhile, and
is refused. The moment costs one that does not little, since flow and velocity carry the position.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, equation, larger, smaller
from flownav.navigation import calls
from flownav.navigation.flow_noise import AGREEMENT_S, alike
from flownav.navigation.memory import MEMORY
from flownav.navigation.reasons import FUSED
from flownav.navigation.records import FlowMemory, LevelMemory, WalkMemory, WitnessMemory
from flownav.navigation.trust import OF_GPS
from flownav.navigation.verdicts import Tested, on_lanes

MOMENT_S = 1.5  # chosen: seven fixes of 5 Hz, in which flow and accelerometer cannot lose the way
SOUND_M_S = 0.6  # sound receivers part from their own velocity by 0.56 m/s at most, over 10 s (integrity.md)
HELD_S = 2.0  # chosen: in it a place that walks on at 1 m/s leaves its gate (test_live_safety)
ONE_ERROR = 1.0  # innovations with the same error are as alike as this and more (`alike`)
HELD_RATIO = 1.0 + 1e-9  # of a place: more than 1 is refused along north and east (`offers.spoilt_whole`)

load_witness, _ = MEMORY.access(WitnessMemory)


class OwnVelocity(NamedTuple):
    """A receiver's velocity along an axis: its last innovation [m/s], when it was fused last, and when its last
    refusals began or ended [s].
    """

    before: float
    fused_s: float
    since_s: float


@equation
def own_velocity(work: Work, lanes: Lanes, axis: int, lane: int) -> OwnVelocity:
    """The receiver's velocity along an axis of a lane."""
    m = load_witness(work, lanes, OF_GPS + 3 + axis, lane)
    return OwnVelocity(m.before, m.fused_s, m.since_s)


MEMORY.derive(OwnVelocity, own_velocity, "axis")


@equation
def is_doubted(flow: FlowMemory) -> bool:
    """Whether flow disagrees with the others: by its size, or in the same way again and again."""
    return flow.doubted > 0.0 or bool(np.isfinite(flow.wrong_s))


@equation
def agrees(fused_s: float, since_s: float, placed_s: float, t_s: float) -> bool:
    """Whether the receiver's own velocity was fused a moment ago, and was not refused since its place was fused.

    fused_s, since_s: as of `OwnVelocity`; placed_s: when the place was fused last; t_s: now [s].
    """
    return t_s - fused_s <= MOMENT_S and since_s <= placed_s


@equation
def contradicted(innovation: float, own: OwnVelocity, flow: FlowMemory, placed_s: float, t_s: float) -> bool:
    """Whether flow and the receiver's own velocity carry the position, and it is not they who lag behind its place.

    placed_s: when the place was fused last. Where the estimate's velocity errs, the receiver's velocity shows it: its
    last innovation then has the sign of the place's.
    """
    flows = not is_doubted(flow) and t_s - flow.taken_s <= MOMENT_S
    return flows and agrees(own.fused_s, own.since_s, placed_s, t_s) and own.before * innovation <= 0.0


@on_lanes(calls.watch_walk)
def watch_walk(
    tested: Tested, own: OwnVelocity, flow: FlowMemory, before: WitnessMemory, m: WalkMemory, *, t_s: float, axis: int
) -> WalkMemory:
    """After the test of a place along north (0) or east (1): how alike innovations that are fused are, on average over
    AGREEMENT_S, while the velocities contradict them.

    A place parts from the velocities by the share of its innovation that the states take: 1 - variance / total.
    """
    step_s = t_s - before.received_s
    parts = abs(tested.innovation) * (tested.total - tested.variance) > SOUND_M_S * step_s * tested.total
    counts = parts and contradicted(tested.innovation, own, flow, before.fused_s, t_s)
    product = alike(tested.innovation, before.before, tested.total) if counts else 0.0
    was = m.alike_n if axis == 0 else m.alike_e
    now = was + smaller(step_s / AGREEMENT_S, 1.0) * (product - was) if tested.reason == FUSED else was
    found = now > ONE_ERROR
    kept = 0.0 if found else now
    return WalkMemory(kept if axis == 0 else m.alike_n, m.alike_e if axis == 0 else kept, t_s if found else m.found_s)


@on_lanes(calls.hold_walk)
def hold_walk(m: LevelMemory, walk: WalkMemory, *, t_s: float) -> LevelMemory:
    """A place that was found to walk is not fused for HELD_S, in which the estimate grows less sure of it."""
    return LevelMemory(larger(m.ratio, HELD_RATIO) if t_s - walk.found_s <= HELD_S else m.ratio)
