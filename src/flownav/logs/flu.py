"""Axes forward-left-up (ROS, Crazyflie, Betaflight, INAV) into the project's forward-right-down.

A vector changes the signs of y and z. A rotation of body FLU to an earth with z up becomes one of body FRD to NED:
from east-north-up both sides are turned, from north-west-up (a heading counted from x) both are half-turned about x.
REP 103 (https://www.ros.org/reps/rep-0103.html) has ROS's axes.
"""

from __future__ import annotations

import numpy as np

from flownav.core.frames import quaternion_product
from flownav.core.measurement import Array

HALF = float(np.sqrt(0.5))
NED_FROM_ENU = (0.0, HALF, HALF, 0.0)
FLU_FROM_FRD = (0.0, 1.0, 0.0, 0.0)


def frd(vector: Array) -> Array:
    """Vectors (n, 3) of body FLU in body FRD; of north-west-up in NED likewise."""
    return np.asarray(vector * (1.0, -1.0, -1.0))


def ned(vector: Array) -> Array:
    """Vectors (n, 3) of east-north-up in north-east-down."""
    return np.asarray(vector[:, [1, 0, 2]] * (1.0, 1.0, -1.0))


def ned_from_frd(wxyz: Array) -> Array:
    """Quaternions (n, 4) of body FLU to ENU, as those of body FRD to NED."""
    left = quaternion_product(NED_FROM_ENU, tuple(wxyz.T))
    return np.column_stack(quaternion_product(left, FLU_FROM_FRD))


def ned_from_frd_of_nwu(wxyz: Array) -> Array:
    """Quaternions (n, 4) of body FLU to north-west-up, as those of body FRD to NED."""
    return np.asarray(wxyz * (1.0, 1.0, -1.0, -1.0))
