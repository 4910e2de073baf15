"""Blocks to arming that no parameter shows: the origin of a vehicle without GPS, and the autopilot's own report."""

from typing import NamedTuple

from flownav.core.errors import InputError, arg
from flownav.live.setup.talk import Talk
from flownav.logs.mavlink.framing import ARDUPILOT, Message, Value

Place = tuple[float, float, float]  # latitude, longitude [deg], altitude [m]
# a parameter of these that is 0 means that the vehicle has no receiver
RECEIVERS = {"ardupilot": ("GPS1_TYPE", "GPS_TYPE"), "px4": ("SYS_HAS_GPS", "EKF2_GPS_CTRL")}
REQUEST_MESSAGE, RUN_CHECKS, ORIGIN = 512, 401, 49  # MAV_CMD, MAV_CMD, GPS_GLOBAL_ORIGIN
SAYS_S = 3.0  # of listening to its messages on arming: chosen, its checks run each second
TRIES, ANSWER_S = 4, 1.0
REFUSAL = ("prearm", "arm:", "preflight", "visodom", "arming denied", "no position")  # words of a refusal
CURED = ("visodom: not healthy",)  # what ends when flownav sends
NEEDS_ORIGIN = (
    "the EKF has no origin: without GPS ArduPilot has no position until somebody sets one (SET_GPS_GLOBAL_ORIGIN). "
    "Give --origin LAT,LON,ALT here, or set it in the ground station"
)


class Readiness(NamedTuple):
    """Whether it could arm. origin_deg_m: of the EKF; missing: what is lacking, in sentences; says: the autopilot's own
    words, those that end when flownav sends left out.
    """

    without_gps: bool = False
    origin_deg_m: Place | None = None
    missing: tuple[str, ...] = ()
    says: tuple[str, ...] = ()


def has_no_gps(make: str, values: dict[str, Value]) -> bool:
    """Whether the vehicle's parameters state that it has no receiver."""
    receivers = [values[name].number for name in RECEIVERS.get(make, ()) if name in values]
    return any(number == 0.0 for number in receivers)


def origin_of(text: str) -> Place:
    """LAT,LON,ALT. InputError where it is no place on earth."""
    try:
        latitude, longitude, altitude_m = map(float, text.split(","))
    except ValueError:
        latitude = longitude = altitude_m = float("nan")
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and abs(altitude_m) <= 9000.0):
        raise InputError(f"{arg('origin')} {text}: LAT,LON,ALT is needed [deg, deg, m], e.g. 47.3977,8.5456,489")
    return latitude, longitude, altitude_m


def origin_of_vehicle(talk: Talk, tries: int = TRIES) -> Place | None:
    """Where the autopilot's frame begins, asked for; None where it has no origin."""
    assert talk.vehicle is not None
    for _ in range(tries):
        ask = (talk.vehicle.system, talk.vehicle.component, REQUEST_MESSAGE, 0, ORIGIN, *(0.0,) * 6)
        talk.say(talk.mav.command_long_encode(*ask))
        end_s = talk.clock() + ANSWER_S
        while talk.clock() < end_s:
            for message in talk.hear():
                if message.msgname == "GPS_GLOBAL_ORIGIN" and (message.latitude or message.longitude):
                    return message.latitude * 1e-7, message.longitude * 1e-7, message.altitude * 1e-3
    return None


def set_origin(talk: Talk, place: Place) -> Place | None:
    """Set it, and ask for it: None where the vehicle does not take it."""
    assert talk.vehicle is not None
    latitude, longitude, altitude_m = place
    numbers = round(latitude * 1e7), round(longitude * 1e7), round(altitude_m * 1e3)
    for _ in range(TRIES):
        talk.say(talk.mav.set_gps_global_origin_encode(talk.vehicle.system, *numbers))
        found = origin_of_vehicle(talk, 1)
        if found is not None:
            return found
    return None


def readiness(talk: Talk, make: str, values: dict[str, Value], origin: Place | None = None) -> Readiness:
    """The conditions that are missing to arm. origin: to be set where the vehicle is disarmed."""
    without = has_no_gps(make, values)
    assert talk.vehicle is not None
    place = set_origin(talk, origin) if origin is not None and talk.armed is False else None
    if without and place is None:
        place = origin_of_vehicle(talk)
    missing = []
    if origin is not None and place is None:
        missing.append(
            "the origin was not set: the vehicle is armed, its EKF still starts (give it again after 20 s), or it does "
            "not take SET_GPS_GLOBAL_ORIGIN"
        )
    elif without and place is None and talk.vehicle.make == ARDUPILOT:
        missing.append(NEEDS_ORIGIN)
    return Readiness(without, place, tuple(missing), tuple(arming_messages(talk)))


def arming_messages(talk: Talk) -> list[str]:
    """The autopilot's messages about arming when it is asked to run its checks, each once; none where it is armed."""
    assert talk.vehicle is not None
    if talk.armed is not False:
        return []
    talk.say(talk.mav.command_long_encode(talk.vehicle.system, talk.vehicle.component, RUN_CHECKS, 0, *(0.0,) * 7))
    found: dict[str, None] = {}
    end_s = talk.clock() + SAYS_S
    while talk.clock() < end_s:
        for message in talk.hear():
            if (text := refusal_of(message)) is not None:
                found[text] = None
    return list(found)


def refusal_of(message: Message) -> str | None:
    """A STATUSTEXT that refuses to arm, but for what ends when flownav sends."""
    if message.msgname != "STATUSTEXT":
        return None
    text = str(message.text).rstrip("\0").strip()
    low = text.lower()
    return text if any(word in low for word in REFUSAL) and not any(word in low for word in CURED) else None
