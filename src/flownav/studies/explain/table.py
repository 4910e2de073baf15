"""The table of hypotheses: one row each, in the order in which they are reported. A new cause: a row, a sign, its
words.

explains: what else such a log shows, and is no cause of its own then.
"""

import tomllib
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

from flownav.core.measurement import Sensor
from flownav.core.parameter_files import shipped
from flownav.studies.explain import (
    body_cures,
    body_signs,
    flow_cures,
    flow_signs,
    height_cures,
    height_signs,
    measured_signs,
    place_cures,
    place_signs,
    setting_signs,
    sight_signs,
    trials,
)
from flownav.studies.explain.case import Case
from flownav.studies.explain.cure import Curing, by_hand_only
from flownav.studies.explain.sign import Found
from flownav.studies.explain.trials import Repairing

WORDS_FILE = "causes.toml"


class Hypothesis(NamedTuple):
    """name; what it needs of the log; the parameters that it reads; the look, the trial and the cure."""

    name: str
    needs: str
    parameters: tuple[str, ...]
    look: Callable[[Case], Found]
    repair: Repairing | None
    cure: Curing
    explains: tuple[str, ...] = ()

    @property
    def words(self) -> dict[str, str]:
        """title, sentence, looks, why, prevent."""
        return words()[self.name]


@lru_cache(maxsize=1)
def words() -> dict[str, dict[str, str]]:
    """The words of each cause, by its name."""
    content = tomllib.loads(shipped(WORDS_FILE).read_text(encoding="utf-8"))
    return {name: group for name, group in content.items() if isinstance(group, dict)}


FLOW_DELAYS = ("EKF2_OF_DELAY", "EK3_FLOW_DELAY")
SOURCES = (
    *(f"EK3_SRC{number}_{what}" for number in (1, 2) for what in ("VELXY", "POSXY", "POSZ")),
    *(f"EKF2_{what}" for what in ("HGT_REF", "GPS_CTRL", "OF_CTRL", "RNG_CTRL", "AID_MASK", "HGT_MODE")),
)
REACH = ("RNGFND1_MAX", "RNGFND1_MAX_CM", *SOURCES)
OFF_RANGE = ("terrain_step", "flow_scale", "baro_wash", "range_spikes")

HYPOTHESES = (
    Hypothesis(
        "vibration",
        "IMU",
        (),
        body_signs.vibration,
        None,
        body_cures.shaking,
        (
            "accel_lying",
            "flow_scale",
            "flow_axes",
            "terrain_step",
            "gps_lag",
            "compass_wrong",
            "flow_delay",
            "flow_noise",
        ),
    ),
    Hypothesis(
        "imu_gap",
        "IMU",
        (),
        body_signs.gap,
        None,
        by_hand_only("Lighten the processor (logging, streams, scripts) and look at the unit's bus and power."),
        ("accel_lying", "terrain_step"),
    ),
    Hypothesis(
        "accel_lying",
        "IMU and attitude",
        (),
        body_signs.lying,
        None,
        body_cures.other_imu,
        ("flow_scale", "compass_wrong", "gps_lag", "baro_wash", "terrain_step", "range_stuck"),
    ),
    Hypothesis(
        "clock_wrong",
        "flow and IMU",
        FLOW_DELAYS,
        flow_signs.clock,
        trials.in_time,
        by_hand_only("Stamp readings by the vehicle's clock (TIMESYNC), or not at all: arrival serves better."),
        ("flow_delay", "flow_gyro", "flow_axes", "flow_scale", "flow_noise"),
    ),
    Hypothesis(
        "flow_axes",
        "flow, and IMU or GPS",
        ("SENS_FLOW_ROT", "FLOW_ORIENT_YAW"),
        flow_signs.axes,
        trials.turned_back,
        flow_cures.axes,
        ("flow_gyro", "flow_scale", "terrain_step", "gps_lag", "flow_delay", "flow_noise"),
    ),
    Hypothesis(
        "flow_gyro",
        "flow with a gyro of its own, and IMU",
        (),
        flow_signs.gyro,
        trials.other_gyro,
        by_hand_only("Mend the gyro's axes in the sensor's firmware, or have it send none: the vehicle's then serves."),
    ),
    Hypothesis(
        "flow_interval",
        "flow with a gyro of its own, and IMU",
        (),
        measured_signs.interval,
        trials.at_its_rate,
        flow_cures.interval,
        ("flow_gyro", "flow_scale", "flow_noise", "flow_axes"),
    ),
    Hypothesis(
        "flow_offset",
        "flow, range, and a reference or GPS",
        (),
        measured_signs.offset,
        trials.without_offset,
        flow_cures.offset,
    ),
    Hypothesis("flow_delay", "flow and IMU", FLOW_DELAYS, flow_signs.delay, trials.in_time, flow_cures.delay),
    Hypothesis(
        "flow_scale",
        "flow, range, and GPS or IMU",
        ("SENS_FLOW_SCALE", "FLOW_FXSCALER", "FLOW_FYSCALER"),
        flow_signs.scale,
        trials.rescaled,
        flow_cures.scale,
    ),
    Hypothesis(
        "switched_to_bad_flow",
        "source sets and flow",
        SOURCES,
        setting_signs.bad_switch,
        None,
        place_cures.bad_switch,
        ("low_texture", "flow_noise", "range_out_of_reach", "flow_silent", "flow_scale", "focus_height", "range_stuck"),
    ),
    Hypothesis(
        "height_deadlock",
        "PX4's parameters and flow",
        SOURCES,
        setting_signs.deadlock,
        None,
        height_cures.deadlock,
        ("source_never_switched", "flow_refused"),
    ),
    Hypothesis(
        "height_noise",
        "parameters",
        ("EK3_ALT_M_NSE", "EKF2_BARO_NOISE", "EKF2_RNG_NOISE"),
        setting_signs.height_noise,
        None,
        height_cures.height_noise,
        ("baro_wash",),
    ),
    Hypothesis(
        "flow_refused",
        "flow and parameters",
        ("EKF2_OF_QMIN", "SENS_FLOW_MINHGT", "SENS_FLOW_MAXHGT"),
        setting_signs.refused,
        None,
        flow_cures.refused,
        ("source_never_switched", "low_texture"),
    ),
    Hypothesis(
        "source_never_switched",
        "flow and parameters",
        SOURCES,
        setting_signs.never_switched,
        None,
        place_cures.never_switched,
    ),
    Hypothesis(
        "low_texture",
        "flow",
        ("EKF2_OF_QMIN", "EK3_FLOW_M_NSE"),
        sight_signs.texture,
        trials.without("flow withheld meanwhile", Sensor.FLOW_RATE),
        flow_cures.texture,
        ("flow_scale", "flow_axes", "focus_height", "flow_noise"),
    ),
    Hypothesis(
        "focus_height",
        "flow, range and IMU",
        ("SENS_FLOW_MINHGT",),
        sight_signs.focus,
        trials.above,
        flow_cures.focus,
        ("flow_scale", "low_texture", "flow_noise"),
    ),
    Hypothesis(
        "flow_noise",
        "flow",
        ("EKF2_OF_N_MIN", "EKF2_OF_N_MAX", "EK3_FLOW_M_NSE"),
        sight_signs.noise,
        trials.without("flow withheld meanwhile", Sensor.FLOW_RATE),
        flow_cures.noise,
        ("flow_scale",),
    ),
    Hypothesis(
        "flow_silent",
        "flow",
        (),
        sight_signs.silent,
        None,
        by_hand_only("Look at connector, bus and power of the flow sensor; a fuller link drops it first."),
        ("low_texture",),
    ),
    Hypothesis(
        "range_out_of_reach",
        "range and another height",
        REACH,
        height_signs.reach,
        None,
        height_cures.reach,
        ("low_texture", "flow_silent", "flow_noise", *OFF_RANGE),
    ),
    Hypothesis(
        "range_stuck",
        "range and another height",
        SOURCES,
        height_signs.stuck,
        trials.without("range withheld meanwhile", Sensor.RANGE),
        height_cures.stuck,
        (*OFF_RANGE, "accel_lying"),
    ),
    Hypothesis(
        "range_spikes",
        "range",
        ("EKF2_RNG_GATE", "EKF2_RNG_NOISE", "EK3_RNG_I_GATE", "EK3_RNG_M_NSE"),
        height_signs.spikes,
        trials.without_echoes,
        height_cures.spikes,
        (*OFF_RANGE, "accel_lying", "focus_height", "range_out_of_reach"),
    ),
    Hypothesis(
        "terrain_step",
        "range",
        SOURCES,
        height_signs.terrain,
        None,
        height_cures.terrain,
        ("range_spikes", "baro_wash"),
    ),
    Hypothesis(
        "baro_wash",
        "barometer and range",
        ("EKF2_HGT_REF", "EKF2_GND_EFF_DZ", "GND_EFFECT_COMP"),
        height_signs.wash,
        trials.without("barometer withheld", Sensor.BARO),
        height_cures.wash,
    ),
    Hypothesis(
        "gps_glitch",
        "GPS with velocity",
        ("EKF2_GPS_P_GATE", "EK3_POS_I_GATE", "EK3_GLITCH_RAD"),
        place_signs.glitch,
        trials.without("GPS withheld meanwhile", *trials.GPS),
        place_cures.glitch,
        ("gps_lag",),
    ),
    Hypothesis(
        "gps_lag",
        "GPS velocity and IMU",
        ("EKF2_GPS_DELAY", "GPS1_DELAY_MS", "GPS_DELAY_MS"),
        place_signs.lag,
        trials.gps_in_time,
        place_cures.lag,
        ("gps_glitch",),
    ),
    Hypothesis(
        "compass_motors",
        "magnetometer, IMU, a stretch on the ground",
        ("COMPASS_MOTCT", "CAL_MAG_COMP_TYP"),
        place_signs.motors,
        trials.without("magnetometer withheld", Sensor.MAG),
        place_cures.motors,
        ("compass_wrong", "gps_lag", "accel_lying"),
    ),
    Hypothesis(
        "compass_wrong",
        "GPS velocity, and IMU or flow",
        ("CAL_MAG0_ROT", "COMPASS_ORIENT"),
        place_signs.compass,
        trials.without("magnetometer withheld", Sensor.MAG),
        place_cures.compass,
        ("gps_lag", "accel_lying", "flow_scale"),
    ),
    Hypothesis(
        "landed_wrong",
        "landing flag and a height",
        ("MPC_THR_HOVER", "MOT_THST_HOVER"),
        body_signs.landed,
        trials.without("the landing flag withheld", Sensor.LANDED),
        body_cures.landing,
    ),
)
BY_NAME = {one.name: one for one in HYPOTHESES}
