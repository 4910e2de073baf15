"""The attitude error, three of the filter's states: what a correction makes of it belongs into the quaternion."""

from flownav.core.compile import Lanes, Work, procedure
from flownav.core.frames import of_unit_length, quaternion_product
from flownav.estimation.states import ATTITUDE, QUATERNION, STATE


@procedure
def fold_attitude(work: Work, lanes: Lanes) -> None:
    """The correction of the attitude error into the quaternion: q <- (1, theta/2) q, of unit length; theta <- 0.

    A lane without a correction keeps every bit.
    """
    for lane in range(len(lanes)):
        north = work[(STATE + ATTITUDE) * len(lanes) + lane]
        east = work[(STATE + ATTITUDE + 1) * len(lanes) + lane]
        down = work[(STATE + ATTITUDE + 2) * len(lanes) + lane]
        turn = (1.0, 0.5 * north, 0.5 * east, 0.5 * down)
        qw = work[QUATERNION * len(lanes) + lane]
        qx = work[(QUATERNION + 1) * len(lanes) + lane]
        qy = work[(QUATERNION + 2) * len(lanes) + lane]
        qz = work[(QUATERNION + 3) * len(lanes) + lane]
        w, x, y, z = of_unit_length(quaternion_product(turn, (qw, qx, qy, qz)))
        corrected = turn[1] != 0.0 or turn[2] != 0.0 or turn[3] != 0.0
        work[QUATERNION * len(lanes) + lane] = w if corrected else qw
        work[(QUATERNION + 1) * len(lanes) + lane] = x if corrected else qx
        work[(QUATERNION + 2) * len(lanes) + lane] = y if corrected else qy
        work[(QUATERNION + 3) * len(lanes) + lane] = z if corrected else qz
        work[(STATE + ATTITUDE) * len(lanes) + lane] = 0.0 if corrected else north
        work[(STATE + ATTITUDE + 1) * len(lanes) + lane] = 0.0 if corrected else east
        work[(STATE + ATTITUDE + 2) * len(lanes) + lane] = 0.0 if corrected else down
