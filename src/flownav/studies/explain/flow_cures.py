"""Cures of a wrong setting of the flow sensor, or of a picture that it cannot read."""

from flownav.lab.identification.parameter_file import FLOAT, INTEGER, within
from flownav.lab.identification.scalers import INAV_DEFAULT
from flownav.studies.explain.autopilot_settings import INAV_SCALE
from flownav.studies.explain.case import Case
from flownav.studies.explain.cure import Cure, Settings, by_hand_only, decimal, either, number, whole
from flownav.studies.explain.sign import Sign

EIGHTH_DEG, NEAR_EIGHTH_DEG = 45.0, 12.0
PX4_OF_DELAY_MS, EKF3_DELAY_MS, EKF3_AVERAGING_MS = 300.0, 250.0, 50.0
MOST_NOISE_RAD_S = 1.0  # the most that EK3_FLOW_M_NSE takes
interval = by_hand_only(
    "Mend the integration time in the sensor's driver or message: no scaler mends it, since autopilots scale the flow "
    "and not the rotation that they take out of it."
)
offset = by_hand_only(
    "Look for what turns with the body: a bias of the sensor's gyro, a reflection, a shadow, a dirty lens. `flownav "
    "identify` writes the offset into the sensor file, and `--sensor` takes it out; neither PX4 nor ArduPilot has a "
    "parameter for it."
)
SCALE_PX4, SCALER_ARDUPILOT = (0.5, 1.5), 800.0


def axes(case: Case, sign: Sign, dialect: str) -> Cure:
    """The mounting's rotation, where that is what is wrong."""
    if sign.figures["mirrored"]:
        return Cure((), "No rotation mends a mirrored sensor: mend the driver's signs, or its firmware.", holds=False)
    turn = (case.own_settings.flow_turn_deg or 0.0) - number(sign, "turn_deg")
    eighths = round(turn / EIGHTH_DEG) % 8
    reason = f"the flow is turned by {-number(sign, 'turn_deg'):.0f} degrees from the set rotation"
    near = abs((turn - eighths * EIGHTH_DEG + 180.0) % 360.0 - 180.0) <= NEAR_EIGHTH_DEG
    px4 = (whole("SENS_FLOW_ROT", float(eighths), reason),) if near else ()
    degrees = eighths * EIGHTH_DEG if near else turn % 360.0
    degrees = degrees - 360.0 if degrees > 180.0 else degrees
    words = "Then push the vehicle forward by hand: flow about y must be positive, and forward velocity with it."
    return either(dialect, px4, (whole("FLOW_ORIENT_YAW", round(100.0 * degrees), reason),), words)


def scale(case: Case, sign: Sign, dialect: str) -> Cure:
    """The factor on the flow."""
    x, y = number(sign, "x"), number(sign, "y")
    reason = f"the flow reads {sign.figures['read']}"
    now, gain = case.own_settings.scale_x or 1.0, number(sign, "gain")
    scalers = []
    for axis, one, was in (("X", x, case.own_settings.scale_x or 1.0), ("Y", y, case.own_settings.scale_y or 1.0)):
        per_mille = float(round(1e3 * (was / one - 1.0)))
        name = f"FLOW_F{axis}SCALER"
        scalers.append(within(name, per_mille, -SCALER_ARDUPILOT, SCALER_ARDUPILOT, INTEGER, reason))
    words = "Check the lens's focus and the range first: `flownav identify` gives the factor with its interval."
    if x != y:
        words = f"PX4 and INAV have one factor for both axes: mend the driver. {words}"
    px4 = within("SENS_FLOW_SCALE", now / gain, *SCALE_PX4, FLOAT, f"{reason} (PX4 1.16 and later)")
    counts = case.log.parameters.get(INAV_SCALE, INAV_DEFAULT)
    known = "" if INAV_SCALE in case.log.parameters else "; where yours is another, set yours times the gain"
    inav = decimal(INAV_SCALE, counts * gain, f"counts a degree: {counts:g} times the gain, as {reason}{known}")
    one_factor = x == y
    return either(dialect, (px4,) * one_factor, tuple(scalers), words, inav=(inav,) * one_factor)


def delay(case: Case, sign: Sign, dialect: str) -> Cure:
    """The flow delay to set in the autopilot's filter."""
    lag = number(sign, "lag_ms")
    reason = f"a reading is {lag:.0f} ms old when it arrives"
    return either(
        dialect,
        (whole("EKF2_OF_DELAY", round(min(max(lag, 0.0), PX4_OF_DELAY_MS)), reason),),
        (
            whole(
                "EK3_FLOW_DELAY",
                round(min(max(lag - EKF3_AVERAGING_MS, 0.0), EKF3_DELAY_MS)),
                f"{reason}; EKF3 takes {EKF3_AVERAGING_MS:.0f} ms off by itself",
            ),
        ),
        "A sensor that comes later than 300 ms is too late for either filter: a faster link is needed.",
    )


def texture(case: Case, sign: Sign, dialect: str) -> Cure:
    """Reject flow that the sensor itself rates as poor, and trust the rest less."""
    quality = number(sign, "quality")
    least = min(max(quality + 20.0, 30.0), 150.0)
    least_stated = case.own_settings.least_quality or 0.0
    one = case.own_settings.set_at(1)
    aided = one is not None and one.gps and case.gps_velocity is not None
    px4: Settings = (decimal("EKF2_OF_N_MAX", 0.8, "rad/s: poor pictures count for less"),)
    if aided:  # without another velocity poor flow is better than none
        px4 += (
            whole("EKF2_OF_QMIN", round(max(least, least_stated)), f"quality was {quality:.0f} where it saw nothing"),
        )
    ardupilot = (decimal("EK3_FLOW_M_NSE", 0.5, "rad/s: flow counts for less beside the inertial readings"),)
    words = "Light the ground, or lay a pattern on it; fly lower. No parameter gives the sensor something to see."
    return either(dialect, px4, ardupilot, words, holds=False)


def noise(case: Case, sign: Sign, dialect: str) -> Cure:
    """As much noise as there is, so that one reading moves the estimate by no more than it is worth."""
    found = number(sign, "noise_rad_s")
    reason = f"rad/s: from reading to reading the flow jumps by {found:.2f}"
    px4 = (
        decimal("EKF2_OF_N_MIN", min(round(found, 2), MOST_NOISE_RAD_S), reason),
        decimal(
            "EKF2_OF_N_MAX", min(round(2.0 * found, 2), 2.0 * MOST_NOISE_RAD_S), f"{reason}; more in poor pictures"
        ),
    )
    ardupilot = (decimal("EK3_FLOW_M_NSE", min(round(found, 2), MOST_NOISE_RAD_S), reason),)
    words = (
        "Find the noise: focus and clean the lens, damp the mount, look for lamps that flicker and for interference. "
    )
    words += "The parameters keep it from shaking the estimate, and do not hold the position any better."
    return either(dialect, px4, ardupilot, words, holds=False)


def focus(case: Case, sign: Sign, dialect: str) -> Cure:
    """The height from which on flow is taken."""
    height = number(sign, "height_m") + case.ground_range_m
    px4 = (
        decimal("SENS_FLOW_MINHGT", min(round(height + 0.05, 2), 1.0), f"m: the flow is noise below {height:.2f} m"),
    )
    words = "Refocus the lens for the lowest height. ArduPilot takes FLOW_HGT_MIN where its firmware has it (4.8). "
    words += "Below the height nothing holds the position: pass through it, do not stay there."
    return either(dialect, px4, (), words)


def refused(case: Case, sign: Sign, dialect: str) -> Cure:
    """The limit that kept the flow out."""
    which, quality = sign.figures["which"], number(sign, "quality")
    height = number(sign, "height_m")
    px4 = {
        "quality": whole(
            "EKF2_OF_QMIN", round(max(0.8 * quality, 1.0)), f"nine readings in ten have {quality:.0f} or more"
        ),
        "too high": decimal(
            "SENS_FLOW_MAXHGT", round(1.3 * height, 1), f"m: it flew at up to {height:.1f} m, where flow was sound"
        ),
        "too low": decimal("SENS_FLOW_MINHGT", 0.08, "m: flow was sound below the limit"),
    }[str(which)]
    return either(dialect, (px4,), (), "")
