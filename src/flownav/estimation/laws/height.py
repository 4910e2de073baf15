"""Height: the rangefinder over ground whose level is a state, and the barometer with its offset."""

from typing import NamedTuple

from flownav.core.compile import larger
from flownav.estimation.law import law
from flownav.estimation.laws import LEAST_UPRIGHT
from flownav.estimation.named import Attitude, Beam, Height, rotation_by


class OnRange(NamedTuple):
    """The Jacobian of a range."""

    pos_d: float
    ground: float
    tilt_n: float
    tilt_e: float


@law
def range_along_boresight(axis: int, height: Height, q: Attitude, *, lens: Beam) -> tuple[float, OnRange]:
    """z = (h - R_31 x - R_32 y)/R_33 - z_lens [m], h = ground - p_d: along body down, over level ground.

    The rangefinder's lens is at (x, y, z_lens) = (forward, right, below), body FRD. theta turns R_3j by
    theta_n R_2j - theta_e R_1j.
    """
    rotation = rotation_by(q)
    upright = larger(rotation[8], LEAST_UPRIGHT)
    drop = height.ground - height.pos_d - rotation[6] * lens.forward_m - rotation[7] * lens.right_m
    slope = drop / (upright * upright)
    return drop / upright - lens.below_m, OnRange(
        pos_d=-1.0 / upright, ground=1.0 / upright,
        tilt_n=-slope * rotation[5] - (rotation[3] * lens.forward_m + rotation[4] * lens.right_m) / upright,
        tilt_e=slope * rotation[2] + (rotation[0] * lens.forward_m + rotation[1] * lens.right_m) / upright,
    )  # fmt: skip


class OnBaro(NamedTuple):
    """The Jacobian of a pressure altitude."""

    pos_d: float
    baro: float


@law
def baro_altitude(axis: int, pos_d: float, baro: float) -> tuple[float, OnBaro]:
    """z = -p_d + offset [m]."""
    return baro - pos_d, OnBaro(pos_d=-1.0, baro=1.0)
