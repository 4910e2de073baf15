"""Cures of a height estimate that follows another quantity than the height."""

from flownav.studies.explain.autopilot_settings import ARDUPILOT, RANGE
from flownav.studies.explain.case import Case
from flownav.studies.explain.cure import Cure, Settings, decimal, either, number, whole
from flownav.studies.explain.sign import Sign


def _not_by_range(case: Case, dialect: str) -> Cure:
    """The height from barometer or GPS instead of the range."""
    one = case.own_settings.set_at(1)
    if one is None or one.height != RANGE:
        return Cure((), "")
    reason = "the height must not follow what is below"
    gps = one.gps
    return either(
        dialect,
        (
            whole("EKF2_HGT_REF", 1.0 if gps else 0.0, reason),
            whole("EKF2_RNG_CTRL", 1.0, "the range serves the flow, and near the ground"),
        ),
        (whole("EK3_SRC1_POSZ", 1.0, reason),),
        "",
    )


def reach(case: Case, sign: Sign, dialect: str) -> Cure:
    """Stay within reach, and state the reach truly."""
    ceiling = number(sign, "ceiling_m")
    limit = round(0.9 * ceiling, 1)
    base = _not_by_range(case, dialect)
    px4 = (
        decimal("SENS_FLOW_MAXHGT", max(limit, 1.0), f"m: the range was good up to {ceiling:.1f} m"),
        decimal("GF_MAX_VER_DIST", max(limit, 1.0), "m: where position rests on flow and range"),
    )
    ardupilot = (
        decimal("RNGFND1_MAX", round(ceiling, 1), "m: the range was good so far (RNGFND1_MAX_CM before 4.7)"),
        decimal("FENCE_ALT_MAX", max(limit, 1.0), "m: where position rests on flow and range"),
    )
    words = (
        "Or fit a rangefinder that reaches farther, and give flow another height to fall back on (EK3_OPTIONS, 4.8)."
    )
    cure = either(dialect, px4, ardupilot, words)
    return cure._replace(settings=(*cure.settings, *base.settings))


def stuck(case: Case, sign: Sign, dialect: str) -> Cure:
    """Take the range out of the height."""
    words = "A rangefinder that repeats a reading has hung: look at its bus, its power, and its firmware."
    return _not_by_range(case, dialect)._replace(by_hand=words, holds=False)


def spikes(case: Case, sign: Sign, dialect: str) -> Cure:
    """A narrower gate and a larger noise."""
    cure = either(
        dialect,
        (
            decimal("EKF2_RNG_GATE", 3.0, "single echoes are refused"),
            decimal("EKF2_RNG_NOISE", 0.3, "m: what is left counts for less"),
            decimal("EKF2_RNG_QLTY_T", 1.0, "s: good for so long before it is believed"),
        ),
        (
            whole("EK3_RNG_I_GATE", 300.0, "hundredths of a sigma: single echoes are refused"),
            decimal("EK3_RNG_M_NSE", 1.0, "m: what is left counts for less"),
        ),
        "A sonar picks up grass and propellers, a lidar dust and sunlight: move it, or fit another.",
        holds=False,
    )
    return cure._replace(settings=(*cure.settings, *_not_by_range(case, dialect).settings))


def terrain(case: Case, sign: Sign, dialect: str) -> Cure:
    """The height from another source than the range."""
    words = "Height by range is for level floors alone."
    return _not_by_range(case, dialect)._replace(by_hand=words)


def wash(case: Case, sign: Sign, dialect: str) -> Cure:
    """Let something else hold the height near the ground."""
    one = case.own_settings.set_at(1)
    gps, ranged = one is not None and one.gps, case.ranges is not None
    off = f"the barometer is {abs(number(sign, 'metres')):.1f} m off with the rotors on"
    px4: Settings = (
        decimal("EKF2_BARO_NOISE", 8.0, f"m: {off}"),
        decimal("EKF2_GND_EFF_DZ", 4.0, "m: near the ground it may be as wrong"),
    )
    px4 += (whole("EKF2_HGT_REF", 1.0, "GPS holds the height"),) if gps else ()
    px4 += (whole("EKF2_RNG_CTRL", 1.0, "near the ground the range helps"),) if ranged else ()
    ardupilot: Settings = (
        whole("GND_EFFECT_COMP", 1.0, "take-off and landing are taken account of"),
        decimal("EK3_ALT_M_NSE", 6.0, f"m: {off}"),
    )
    if ranged and not gps:
        ardupilot += (whole("EK3_SRC1_POSZ", 2.0, "indoors over a level floor the range holds the height"),)
    words = "Cover the barometer with open-cell foam and keep the case's holes out of the wash: that is the cure."
    return either(dialect, px4, ardupilot, words, holds=not (gps and dialect == ARDUPILOT))


def deadlock(case: Case, sign: Sign, dialect: str) -> Cure:
    """The height from the barometer, so that the ground is estimated and flow can begin."""
    reason = "with the range as the height the ground is not estimated, and flow waits for it"
    px4 = (whole("EKF2_HGT_REF", 0.0, reason), whole("EKF2_RNG_CTRL", 1.0, "the range then serves the flow"))
    return either(dialect, px4, (), "Firmware that lets flow begin on the range alone does not need this (PX4 26960).")


def height_noise(case: Case, sign: Sign, dialect: str) -> Cure:
    """The noise that the height's source has."""
    one = case.own_settings.set_at(1)
    name, value = ("EKF2_RNG_NOISE", 0.1) if one is not None and one.height == RANGE else ("EKF2_BARO_NOISE", 3.5)
    return either(
        dialect,
        (decimal(name, value, "m: as PX4 ships it"),),
        (decimal("EK3_ALT_M_NSE", 2.0, "m: as ArduPilot ships it"),),
        "",
    )
