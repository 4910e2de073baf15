"""GPS_RAW_INT, ODOMETRY, VISION_POSITION_ESTIMATE, LANDING_TARGET, EXTENDED_SYS_STATE: where the vehicle is."""

import math
from collections.abc import Iterator, Sequence

from flownav.core.frames import euler_from_quaternion, rotation_from_quaternion, to_body
from flownav.core.measurement import Measurement, Sensor
from flownav.logs.mavlink.converted import LARGEST_UNIT_ERROR, NAN, Context, Dropped, Outcome, quality_of, reading
from flownav.logs.mavlink.framing import Message

UNKNOWN_16 = 65535
LEAST_FIX = 3  # 3-D
FULL_TURN_CDEG = 36000
RANGE_ERROR_M = 2.1  # per axis at DOP 1: the 2.5 m CEP that receivers of 1 m class state (u-blox M8 data sheet)
LOCAL_NED, BODY_NED, BODY_FRD, LOCAL_FRD = 1, 8, 12, 20  # MAV_FRAME
ON_GROUND = 1
# the diagonal of a 6x6 matrix in its upper triangle, row by row
DIAGONAL = (0, 6, 11, 15, 18, 20)
HIGHEST_ANGLE_RAD = 1.5


def gps_raw_int(message: Message, t_s: float, context: Context) -> Iterator[Outcome]:
    """GPS_RAW_INT (#24): 1e-7 deg, mm above mean sea level, cm/s over ground, course in 0.01 deg.

    Traps. Before the first fix all is 0. `vel` and `cog` of 65535 are unknown; there is no vertical velocity.
    `h_acc`, `v_acc`, `vel_acc` [mm, mm/s] are extension fields, 0 where absent; `eph`, `epv` are dilutions of
    precision times 100 (65535 unknown), which are factors on the receiver's range error, so 2.1 m of it is taken.
    `yaw` (of two antennas, 0.01 deg): 0 is not available, 65535 not measured now, north is 36000.
    Position needs the context's origin.
    """
    if message.fix_type < LEAST_FIX:
        yield Dropped(Sensor.GPS_POSITION, "no_fix")
        return
    if message.vel != UNKNOWN_16 and message.cog != UNKNOWN_16:
        speed, course = message.vel * 1e-2, math.radians(message.cog * 1e-2)
        velocity = (speed * math.cos(course), speed * math.sin(course), NAN)
        variance = _square(message.vel_acc * 1e-3)
        yield Measurement(t_s, Sensor.GPS_VELOCITY, velocity, (variance, variance, NAN))
    fix = fix_deg_m(message)
    if context.origin_deg_m is None:
        yield Dropped(Sensor.GPS_POSITION, "no_origin")
    elif fix is None:
        yield Dropped(Sensor.GPS_POSITION, "out_of_range")
    else:
        across = _square(_accuracy_m(message.h_acc, message.eph))
        along = _square(_accuracy_m(message.v_acc, message.epv))
        position = local_position_m(fix, context.origin_deg_m)
        yield Measurement(t_s, Sensor.GPS_POSITION, position, (across, across, along))
    if 0 < message.yaw <= FULL_TURN_CDEG:
        heading = math.radians(message.yaw * 1e-2) % (2.0 * math.pi)
        yield Measurement(t_s, Sensor.YAW, (heading,), (_square(math.radians(message.hdg_acc * 1e-5)),))


def fix_deg_m(message: Message) -> tuple[float, float, float] | None:
    """Latitude, longitude [deg] and altitude [m] of a GPS_RAW_INT; None beyond the poles or the date line."""
    latitude, longitude = message.lat * 1e-7, message.lon * 1e-7
    return (latitude, longitude, message.alt * 1e-3) if abs(latitude) <= 90.0 and abs(longitude) <= 180.0 else None


def local_position_m(
    position_deg_m: tuple[float, float, float], origin_deg_m: tuple[float, float, float]
) -> tuple[float, float, float]:
    """North, east, down [m] of a latitude, longitude [deg] and altitude [m] about an origin."""
    import pymap3d

    north, east, down = pymap3d.geodetic2ned(*position_deg_m, *origin_deg_m)
    return float(north), float(east), float(down)


def odometry(message: Message, t_s: float, context: Context) -> Iterator[Outcome]:
    """ODOMETRY (#331) of another component: its position and, from north, its heading.

    Traps. An autopilot's own ODOMETRY is its estimate, not a measurement, and yields nothing. LOCAL_FRD's first
    axis is not north, so no heading. The covariance is the upper triangle of 6x6, row by row; NaN first: unknown.
    quality -1: it has failed; 0: unstated; 1..100 percent.
    """
    if context.autopilot:
        return
    if message.quality < 0:
        yield Dropped(Sensor.POSE, "failed")
        return
    if message.frame_id not in (LOCAL_NED, LOCAL_FRD):
        yield Dropped(Sensor.POSE, "unknown_frame")
        return
    variance = _diagonal(message.pose_covariance)
    quality = quality_of(message.quality)
    yield Measurement(t_s, Sensor.POSE, (message.x, message.y, message.z), variance[:3], 0.0, quality)
    w, x, y, z = message.q
    if message.frame_id == LOCAL_NED and abs(w * w + x * x + y * y + z * z - 1.0) <= LARGEST_UNIT_ERROR:
        yaw = float(euler_from_quaternion(w, x, y, z)[2])
        yield Measurement(t_s, Sensor.YAW, (yaw,), (variance[5],), 0.0, quality)


def vision_position_estimate(message: Message, t_s: float, context: Context) -> Iterator[Outcome]:
    """VISION_POSITION_ESTIMATE (#102): north, east, down [m], roll, pitch, yaw [rad]; covariance as ODOMETRY's."""
    variance = _diagonal(message.covariance)
    yield Measurement(t_s, Sensor.POSE, (message.x, message.y, message.z), variance[:3])
    yield Measurement(t_s, Sensor.YAW, (message.yaw,), (variance[5],))


def landing_target(message: Message, t_s: float, context: Context) -> Iterator[Outcome]:
    """LANDING_TARGET (#149): two angles [rad] and a distance [m], or a position [m] where position_valid is 1.

    Traps. The angles are those of the image, whose top looks forward: angle_x to the right, angle_y backwards
    (ArduPilot: the target's direction is (-tan angle_y, tan angle_x, 1)). A distance of 0 is unknown. A position in
    LOCAL_NED is the pad's in the earth: the vehicle's pose, known to the context, is taken off.
    """
    if message.position_valid == 1:
        position = _pad_in_body(message, context)
        if isinstance(position, str):
            yield Dropped(Sensor.PAD, position)
        else:
            x, y, z = position
            yield reading(Sensor.PAD, t_s, x / z, y / z, math.sqrt(x * x + y * y + z * z))
    elif not (abs(message.angle_x) < HIGHEST_ANGLE_RAD and abs(message.angle_y) < HIGHEST_ANGLE_RAD):
        yield Dropped(Sensor.PAD, "out_of_range")
    else:
        distance = message.distance if message.distance > 0.0 else NAN
        yield reading(Sensor.PAD, t_s, -math.tan(message.angle_y), math.tan(message.angle_x), distance)


def extended_sys_state(message: Message, t_s: float, context: Context) -> Iterator[Outcome]:
    """EXTENDED_SYS_STATE (#245): 1 on the ground; in air, taking off and landing are flight; 0 is not known."""
    if message.landed_state:
        yield reading(Sensor.LANDED, t_s, float(message.landed_state == ON_GROUND))
    else:
        yield Dropped(Sensor.LANDED, "undefined")


def _pad_in_body(message: Message, context: Context) -> tuple[float, float, float] | str:
    """The pad from the vehicle in body axes [m], or why it is not known."""
    x, y, z = message.x, message.y, message.z
    if message.frame == LOCAL_NED:
        if context.pose is None:
            return "no_pose"
        north, east, down = context.pose.pos_ned_m
        x, y, z = to_body(rotation_from_quaternion(*context.pose.quaternion), x - north, y - east, z - down)
    elif message.frame not in (BODY_FRD, BODY_NED):
        return "unknown_frame"
    if not math.isfinite(x + y + z):
        return "not_finite"
    return (float(x), float(y), float(z)) if z > 0.0 else "out_of_range"


def _accuracy_m(accuracy_mm: int, dilution: int) -> float:
    if accuracy_mm:
        return accuracy_mm * 1e-3
    return NAN if dilution in (0, UNKNOWN_16) else dilution * 1e-2 * RANGE_ERROR_M


def _square(sigma: float) -> float:
    """A variance; NaN where the sigma is 0, which means unstated."""
    return sigma * sigma if sigma else NAN


def _diagonal(triangle: Sequence[float]) -> tuple[float, ...]:
    """The variances of a covariance; NaN where it is unknown (its first entry NaN) or all 0."""
    if math.isnan(triangle[0]):
        return (NAN,) * 6
    return tuple(triangle[place] if triangle[place] > 0.0 else NAN for place in DIAGONAL)
