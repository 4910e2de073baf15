"""Cures of a vehicle that shakes, an inertial unit that reads wrong, and a landing detected in flight."""

from flownav.studies.explain.case import Case
from flownav.studies.explain.cure import Cure, decimal, either, whole
from flownav.studies.explain.sign import Sign


def shaking(case: Case, sign: Sign, dialect: str) -> Cure:
    """Filters, after the mounting."""
    px4 = (
        decimal("IMU_ACCEL_CUTOFF", 15.0, "Hz: the accelerometer's low-pass"),
        decimal("EKF2_ACC_NOISE", 1.0, "m/s2: it counts for less"),
    )
    ardupilot = (
        whole("INS_ACCEL_FILTER", 10.0, "Hz: the accelerometer's low-pass"),
        whole("INS_HNTCH_ENABLE", 1.0, "a notch at the rotors' speed"),
        decimal("EK3_ACC_P_NSE", 0.7, "m/s2: it counts for less"),
    )
    words = "Balance propellers and motors and mount the board softly: what clips is lost before any filter."
    return either(dialect, px4, ardupilot, words, holds=False)


def other_imu(case: Case, sign: Sign, dialect: str) -> Cure:
    """Let several units vote."""
    px4 = (whole("EKF2_MULTI_IMU", 3.0, "a filter for each unit"), whole("SENS_IMU_MODE", 0.0, "the filters vote"))
    ardupilot = (
        whole("EK3_IMU_MASK", 3.0, "a lane for each of two units"),
        whole("INS_USE2", 1.0, "the second unit serves"),
    )
    words = "Calibrate the accelerometer, at working temperature too; if it lies again, replace the unit."
    return either(dialect, px4, ardupilot, words, holds=False)


def landing(case: Case, sign: Sign, dialect: str) -> Cure:
    """Cure of the landing detector's thresholds."""
    px4 = (
        whole("MPC_USE_HTE", 1.0, "the hover thrust is found in flight"),
        decimal("LNDMC_Z_VEL_MAX", 0.15, "m/s: slower than any descent"),
        decimal("LNDMC_XY_VEL_MAX", 0.5, "m/s: slower than it drifted"),
    )
    ardupilot = (whole("MOT_HOVER_LEARN", 2.0, "the hover throttle is learnt and kept"),)
    return either(
        dialect,
        px4,
        ardupilot,
        "Set the hover thrust to what the flight shows (MPC_THR_HOVER, MOT_THST_HOVER).",
        holds=False,
    )
