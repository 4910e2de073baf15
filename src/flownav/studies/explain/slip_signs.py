"""Sign of a vehicle that slides over the ground before it flies: only a position reference sees it.

On the ground a navigator takes the vehicle to stand. Flow so near to the floor is out of focus, and the shaking of the
rotors that run up hides the slide from the accelerometer.
"""

import numpy as np

from flownav.core.measurement import Array
from flownav.core.record import POSITION_NED
from flownav.studies.explain.case import Case
from flownav.studies.explain.sign import Found, Lack, Picture, Sign, Trace

SLID_M = 0.05  # chosen: what a small vehicle drifts on flow in some ten seconds
LIFTED_M, BEFORE_S, LEAST_STAND_S, REST_S = 0.02, 5.0, 0.5, 0.2


def slid(case: Case) -> Found:
    """Level motion by the reference in the last seconds before the vehicle is higher than it stood."""
    if case.log.truth is None:
        return Lack("no position reference, which alone sees it slide")
    t_s = np.asarray(case.log.truth["t_s"], float)
    place: Array = np.column_stack([np.asarray(case.log.truth[name], float) for name in POSITION_NED])
    known = np.isfinite(place).all(axis=1)
    t_s, place = t_s[known], place[known]
    if not len(t_s):
        return Lack("no position reference, which alone sees it slide")
    up_m = float(np.median(place[t_s <= t_s[0] + REST_S, 2])) - place[:, 2]
    lifted = np.flatnonzero(up_m > LIFTED_M)
    lift_s = float(t_s[lifted[0]]) if len(lifted) else np.inf
    stands = (t_s < lift_s) & (t_s >= lift_s - BEFORE_S)
    if not np.isfinite(lift_s) or lift_s - t_s[0] < LEAST_STAND_S or np.count_nonzero(stands) < 2:
        return Lack("no stand on the ground before take-off that the reference shows")
    begin_s = float(t_s[stands][0])
    first = np.median(place[stands & (t_s <= begin_s + REST_S), :2], axis=0)
    away = np.hypot(*(place[stands, :2] - first).T)
    most = int(np.argmax(away))
    from_s = float(t_s[stands][int(np.argmax(away > 0.2 * away[most]))])
    picture = Picture("from where it stood (m)", (
        Trace("truth", "level, by the reference", t_s[stands], away),
        Trace("estimate", "upwards, by the reference", t_s[stands], up_m[stands]),
    ), "It moves level before it moves upwards.")  # fmt: skip
    figures: dict[str, float | str] = {"centimetres": 100.0 * float(away[most]), "lift_s": lift_s}
    return Sign(float(away[most]) / SLID_M, (from_s, lift_s), figures, (picture,))
