"""Cures of GPS, of the compass and of the choice among sources."""

from flownav.studies.explain.autopilot_settings import ARDUPILOT, PX4
from flownav.studies.explain.case import Case
from flownav.studies.explain.cure import Cure, Settings, decimal, either, number, whole
from flownav.studies.explain.sign import Sign

EIGHTH_DEG, NEAR_EIGHTH_DEG = 45.0, 16.0
PX4_GPS_DELAY_MS, EKF3_DELAY_MS = 300.0, 250.0
HOVER_THROTTLE = 0.4


def lag(case: Case, sign: Sign, dialect: str) -> Cure:
    """The GPS delay to set in the autopilot's filter."""
    late = max(number(sign, "lag_ms") - 200.0, 0.0)  # of its own velocity, which every receiver smooths
    reason = f"its velocity is {number(sign, 'lag_ms'):.0f} ms behind, of which a receiver smooths 200 ms away"
    return either(
        dialect,
        (whole("EKF2_GPS_DELAY", round(min(late, PX4_GPS_DELAY_MS)), reason),),
        (whole("GPS1_DELAY_MS", round(min(late, EKF3_DELAY_MS)), reason),),
        "A faster rate and a faster link bring the fixes sooner: 5 Hz or more, 115200 baud or CAN.",
        holds=late <= {PX4: PX4_GPS_DELAY_MS, ARDUPILOT: EKF3_DELAY_MS}.get(dialect, 0.0),
    )


def glitch(case: Case, sign: Sign, dialect: str) -> Cure:
    """Narrower gates, and flow in addition to GPS."""
    flow = case.flow is not None
    px4: Settings = (
        decimal("EKF2_GPS_P_GATE", 3.0, "sigma: jumps are refused"),
        decimal("EKF2_REQ_EPH", 2.0, "m: poor fixes are not begun with"),
    )
    px4 += (whole("EKF2_OF_CTRL", 1.0, "flow holds the velocity meanwhile"),) if flow else ()
    ardupilot: Settings = (
        whole("EK3_POS_I_GATE", 300.0, "hundredths of a sigma: jumps are refused"),
        whole("EK3_GLITCH_RAD", 5.0, "m: larger jumps are a glitch"),
    )
    ardupilot += (whole("EK3_SRC_OPTIONS", 1.0, "velocities of all sources are fused, flow's too"),) if flow else ()
    words = "Keep away from walls, or switch to flow before you come near them."
    return either(dialect, px4, ardupilot, words, holds=False)


def compass(case: Case, sign: Sign, dialect: str) -> Cure:
    """The compass's mounting where it is turned by eighths; else not the compass."""
    turn = number(sign, "turn_deg")
    now = {PX4: "CAL_MAG0_ROT", ARDUPILOT: "COMPASS_ORIENT"}.get(dialect, "")
    was = case.log.parameters.get(now, 0.0)
    eighths = round(turn / EIGHTH_DEG)
    mounting = not number(sign, "in_flight")  # it does not turn in flight
    near = mounting and abs(turn - eighths * EIGHTH_DEG) <= NEAR_EIGHTH_DEG and eighths != 0 and 0.0 <= was <= 7.0
    reason = f"the {'heading is' if mounting else 'compass went'} {turn:.0f} degrees off"
    if near:
        new = float((was + eighths) % 8)
        return either(
            dialect,
            (whole("CAL_MAG0_ROT", new, reason),),
            (whole("COMPASS_ORIENT", new, reason),),
            "Calibrate anew after.",
        )
    return either(
        dialect,
        (whole("EKF2_MAG_TYPE", 5.0, f"{reason}: the heading is found from GPS in flight instead"),),
        (
            whole("EK3_SRC1_YAW", 8.0, f"{reason}: the heading is found from GPS in flight instead"),
            whole("COMPASS_USE", 0.0, "until it is calibrated"),
        ),
        "Calibrate the compass outdoors, away from iron, and look for iron beside it.",
        holds=False,
    )


def motors(case: Case, sign: Sign, dialect: str) -> Cure:
    """Compensate by throttle what the motors add."""
    hover = case.log.parameters.get("MOT_THST_HOVER", case.log.parameters.get("MPC_THR_HOVER", HOVER_THROTTLE))
    added = [number(sign, f"{axis}_mgauss") / max(hover, 0.1) for axis in "xyz"]
    reason = "mgauss at full throttle, less what the motors add"
    by_axis = list(zip("XYZ", added, strict=True))
    px4 = (
        whole("CAL_MAG_COMP_TYP", 1.0, "by throttle"),
        *(decimal(f"CAL_MAG0_{axis}COMP", -1e-3 * value, "gauss at full throttle") for axis, value in by_axis),
    )
    ardupilot = (
        whole("COMPASS_MOTCT", 1.0, "by throttle"),
        *(decimal(f"COMPASS_MOT_{axis}", -value, reason) for axis, value in by_axis),
    )
    words = (
        "Better: raise the compass on a mast and twist the power leads; then CompassMot, or PX4's power compensation."
    )
    return either(dialect, px4, ardupilot, words)


def never_switched(case: Case, sign: Sign, dialect: str) -> Cure:
    """Use flow in addition to GPS, so that no switch is needed."""
    px4 = (whole("EKF2_OF_CTRL", 1.0, "flow is taken"),)
    place = 3.0 if case.gps_velocity is not None else 0.0
    ardupilot = (
        whole("EK3_SRC1_VELXY", 5.0, "velocity from the flow"),
        whole("EK3_SRC1_POSXY", place, "position from GPS where there is some" if place else "flow alone"),
        whole("EK3_SRC_OPTIONS", 1.0, "velocities of all sources are fused: nobody has to switch"),
    )
    words = "Or switch in flight: RCx_OPTION 90, or the script ahrs-source-gps-optflow.lua (SCR_ENABLE 1)."
    return either(dialect, px4, ardupilot, words)


def bad_switch(case: Case, sign: Sign, dialect: str) -> Cure:
    """Let a script choose, by range and quality."""
    ardupilot = (
        whole("SCR_ENABLE", 1.0, "for ahrs-source-gps-optflow.lua, which looks before it switches"),
        decimal("SCR_USER1", round(0.8 * (case.own_settings.range_high_m or 5.0), 1), "m: no flow above this range"),
        decimal("SCR_USER3", 50.0, "no flow of a lower quality"),
    )
    return either(
        dialect,
        (),
        ardupilot,
        "Switch to flow only below the rangefinder's reach and over a ground with texture.",
        holds=False,
    )
