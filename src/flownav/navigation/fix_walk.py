"""A receiver whose place walks off while its own velocity and the flow show that the vehicle does not go there.

Innovations of a filter whose model holds are white. Those of a place that walks are alike: the position takes a part of
each, however slowly it walks, and no gate refuses them. Two witnesses of the velocity contradict it then, the
receiver's own and the flow. So its place is held back for a moment: one that walks on leaves its gate meanwhile, and
is refused. The moment costs one that does not little, since flow and velocity carry the position.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, equation, larger, replacing, row_of, smaller
from flownav.estimation.states import GPS_VELOCITY, STATE
from flownav.navigation import calls
from flownav.navigation.flow_noise import AGREEMENT_S, alike
from flownav.navigation.memory import MEMORY
from flownav.navigation.reasons import FUSED
from flownav.navigation.records import FlowMemory, GpsMemory, LevelMemory, WitnessMemory
from flownav.navigation.trust import OF_GPS
from flownav.navigation.verdicts import Tested, on_lanes

MOMENT_S = 1.5  # chosen: seven fixes of 5 Hz, in which flow and accelerometer cannot lose the way
SOUND_M_S = 0.6  # sound receivers part from their own velocity by 0.56 m/s at most, over 10 s (integrity.md)
LONGEST_S = 2.0  # after it a place that parts as fast has left its gate of a metre
ONE_ERROR = 1.0  # innovations with the same error are as alike as this and more (`alike`)
HELD_RATIO = 1.0 + 1e-9  # of a place: more than 1 is refused along north and east (`offers.spoilt_whole`)

with_walk = replacing(GpsMemory, "alike_n", "alike_e", "walked_s", "walked_ratio")
load_witness, _ = MEMORY.access(WitnessMemory)


class OwnVelocity(NamedTuple):
    """A receiver's velocity along an axis: its lasting error by the filter and its last innovation [m/s], when it was
    fused last, and when its last refusals began or ended [s].
    """

    error_m_s: float
    before: float
    fused_s: float
    since_s: float


@equation
def own_velocity(work: Work, lanes: Lanes, axis: int, lane: int) -> OwnVelocity:
    """The receiver's velocity along an axis of a lane."""
    m = load_witness(work, lanes, OF_GPS + 3 + axis, lane)
    return OwnVelocity(row_of(work, lanes, STATE + GPS_VELOCITY + axis, lane), m.before, m.fused_s, m.since_s)


MEMORY.derive(OwnVelocity, own_velocity, "axis")


@equation
def contradicted(innovation: float, own: OwnVelocity, flow: FlowMemory, t_s: float, fused_s: float) -> bool:
    """Whether flow and the receiver's own velocity carry the position, and it is not they who lag behind its place.

    fused_s: when a place was fused last. A velocity that errs is seen by the receiver's, too: its last innovation or
    its error by the filter has the sign of the place's innovation then.
    """
    flowed = not (flow.doubted > 0.0 or np.isfinite(flow.wrong_s)) and t_s - flow.taken_s <= MOMENT_S
    agrees = t_s - own.fused_s <= MOMENT_S and own.since_s <= fused_s
    return flowed and agrees and own.error_m_s * innovation <= 0.0 and own.before * innovation <= 0.0


@on_lanes(calls.watch_walk)
def watch_walk(
    tested: Tested, own: OwnVelocity, flow: FlowMemory, before: WitnessMemory, level: LevelMemory, m: GpsMemory,
    *, t_s: float, axis: int,
) -> GpsMemory:  # fmt: skip
    """After the test of a place along north (0) or east (1): how alike innovations that are fused are, on average over
    AGREEMENT_S, while the velocities contradict them.
    """
    step_s = t_s - before.received_s
    parted_m = abs(tested.innovation) * (1.0 - tested.variance / tested.total)  # what the states take of it
    counts = contradicted(tested.innovation, own, flow, t_s, before.fused_s) and parted_m > SOUND_M_S * step_s
    product = alike(tested.innovation, before.before, tested.total) if counts else 0.0
    was = m.alike_n if axis == 0 else m.alike_e
    now = was + smaller(step_s / AGREEMENT_S, 1.0) * (product - was) if tested.reason == FUSED else was
    found = now > ONE_ERROR
    kept = 0.0 if found else now
    return with_walk(
        m,
        alike_n=kept if axis == 0 else m.alike_n,
        alike_e=m.alike_e if axis == 0 else kept,
        walked_s=t_s if found else m.walked_s,
        walked_ratio=level.ratio if found else m.walked_ratio,
    )


@on_lanes(calls.hold_walk)
def hold_walk(m: LevelMemory, gps: GpsMemory, *, t_s: float) -> LevelMemory:
    """A place that was found to walk is not fused for AGREEMENT_S, nor for LONGEST_S where it goes on parting from the
    estimate, which grows less sure meanwhile.
    """
    since_s = t_s - gps.walked_s
    held = since_s <= AGREEMENT_S or (since_s <= LONGEST_S and m.ratio > gps.walked_ratio)
    return LevelMemory(larger(m.ratio, HELD_RATIO) if held else m.ratio)
