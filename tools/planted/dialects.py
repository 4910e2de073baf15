"""Parameters as a vehicle of either autopilot carries them that is set up well for a flight outdoors or indoors."""

from __future__ import annotations

from flownav.core.measurement import Sensor
from flownav.logs.log import Log

EKF3_AVERAGING_MS = 50.0  # EKF3 takes half of flowTimeDeltaAvg_ms off by itself, beside EK3_FLOW_DELAY


def good_parameters(dialect: str, log: Log) -> dict[str, float]:
    """Parameters that suit a sound log's sensors; with GPS where the log has some."""
    outdoors = Sensor.GPS_POSITION in log.streams
    flow_ms = 1e3 * log.streams[Sensor.FLOW_RATE].delay_s
    gps_ms = 1e3 * log.streams[Sensor.GPS_POSITION].delay_s if outdoors else 110.0
    least_m, most_m = log.limits["range_m"]
    return (
        _px4(outdoors, flow_ms, gps_ms) if dialect == "px4" else _ardupilot(outdoors, flow_ms, gps_ms, least_m, most_m)
    )


def _px4(outdoors: bool, flow_ms: float, gps_ms: float) -> dict[str, float]:
    return {
        "EKF2_EN": 1, "EKF2_HGT_REF": 1 if outdoors else 0, "EKF2_GPS_CTRL": 7 if outdoors else 0, "EKF2_OF_CTRL": 1,
        "EKF2_RNG_CTRL": 1, "EKF2_BARO_CTRL": 1, "EKF2_EV_CTRL": 0, "EKF2_MAG_TYPE": 0, "EKF2_GPS_DELAY": round(gps_ms),
        "EKF2_OF_DELAY": round(flow_ms), "EKF2_OF_QMIN": 1, "EKF2_OF_QMIN_GND": 0, "EKF2_OF_N_MIN": 0.15,
        "EKF2_OF_N_MAX": 0.5, "EKF2_OF_GATE": 3.0, "EKF2_RNG_NOISE": 0.1, "EKF2_BARO_NOISE": 3.5,
        "EKF2_RNG_A_HMAX": 5.0, "EKF2_RNG_A_VMAX": 1.0, "EKF2_GND_EFF_DZ": 4.0, "EKF2_GND_MAX_HGT": 0.5,
        "EKF2_MIN_RNG": 0.1,
        "SENS_FLOW_ROT": 0, "SENS_FLOW_MINHGT": 0.08, "SENS_FLOW_MAXHGT": 25.0, "SENS_FLOW_MAXR": 7.4,
        "SENS_FLOW_SCALE": 1.0, "CAL_MAG0_ROT": 0, "CAL_MAG0_ID": 396809, "CAL_MAG_COMP_TYP": 0, "MPC_THR_HOVER": 0.5,
        "MPC_ALT_MODE": 0, "LNDMC_Z_VEL_MAX": 0.25, "LNDMC_XY_VEL_MAX": 1.5, "SYS_HAS_GPS": 1 if outdoors else 0,
        "SYS_HAS_MAG": 1, "SYS_HAS_BARO": 1, "IMU_ACCEL_CUTOFF": 30.0, "IMU_GYRO_CUTOFF": 40.0,
    }  # fmt: skip


def _ardupilot(outdoors: bool, flow_ms: float, gps_ms: float, least_m: float, most_m: float) -> dict[str, float]:
    first = (3, 3, 3) if outdoors else (0, 5, 0)  # POSXY, VELXY, VELZ of the first source set
    return {
        "AHRS_EKF_TYPE": 3, "EK3_ENABLE": 1, "EK3_SRC1_POSXY": first[0], "EK3_SRC1_VELXY": first[1],
        "EK3_SRC1_POSZ": 1, "EK3_SRC1_VELZ": first[2], "EK3_SRC1_YAW": 1, "EK3_SRC2_POSXY": 0, "EK3_SRC2_VELXY": 0,
        "EK3_SRC2_POSZ": 1, "EK3_SRC2_VELZ": 0, "EK3_SRC2_YAW": 0, "EK3_SRC3_POSXY": 0, "EK3_SRC3_VELXY": 0,
        "EK3_SRC3_POSZ": 1, "EK3_SRC3_VELZ": 0, "EK3_SRC3_YAW": 0, "EK3_SRC_OPTIONS": 1, "EK3_ALT_M_NSE": 2.0,
        "EK3_FLOW_DELAY": round(max(flow_ms - EKF3_AVERAGING_MS, 0.0)), "EK3_FLOW_M_NSE": 0.25, "EK3_FLOW_I_GATE": 300,
        "EK3_FLOW_MAX": 2.5, "EK3_FLOW_USE": 1, "EK3_RNG_M_NSE": 0.5, "EK3_RNG_USE_HGT": -1, "EK3_MAG_CAL": 3,
        "FLOW_TYPE": 6, "FLOW_FXSCALER": 0, "FLOW_FYSCALER": 0, "FLOW_ORIENT_YAW": 0, "FLOW_POS_X": 0.0,
        "RNGFND1_TYPE": 24, "RNGFND1_MIN": least_m, "RNGFND1_MAX": most_m, "RNGFND1_ORIENT": 25, "RNGFND1_GNDCLR": 0.1,
        "GPS1_TYPE": 1 if outdoors else 0, "GPS1_DELAY_MS": round(gps_ms) if outdoors else 0, "COMPASS_ENABLE": 1,
        "COMPASS_USE": 1, "COMPASS_ORIENT": 0, "COMPASS_EXTERNAL": 1, "COMPASS_MOTCT": 0, "COMPASS_MOT_X": 0.0,
        "COMPASS_MOT_Y": 0.0, "COMPASS_MOT_Z": 0.0, "COMPASS_LEARN": 0, "GND_EFFECT_COMP": 1, "INS_ACCEL_FILTER": 20,
        "INS_HNTCH_ENABLE": 1, "VISO_TYPE": 0, "PLND_ENABLED": 0, "MOT_THST_HOVER": 0.35, "SCR_ENABLE": 0,
    }  # fmt: skip
