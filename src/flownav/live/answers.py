"""The current estimate, whether it may be sent, and the messages that go to the vehicle."""

import math
from functools import cache
from typing import Any

import numpy as np

from flownav.core.compile import ONE_LANE
from flownav.core.frames import Vector, rotation_from_quaternion, to_body
from flownav.core.measurement import Array
from flownav.estimation.states import PAD, QUATERNION, STATE
from flownav.live.anchor import NOTHING, Base, holds
from flownav.live.options import Limits, Options
from flownav.live.reception import Vehicle
from flownav.logs.mavlink import outgoing as say
from flownav.logs.mavlink.framing import PX4, Message, coder
from flownav.logs.mavlink.position_messages import LOCAL_FRD, LOCAL_NED
from flownav.logs.mavlink.signing import sign_outgoing
from flownav.navigation.loop import Running
from flownav.navigation.memory import (
    PAD_KNOWN,
    PROTECTION,
    SUSPECTED,
    load_aid,
    load_flow,
    load_imu,
    load_start,
    load_suspicion,
)
from flownav.navigation.now import NowRow
from flownav.navigation.pad import SEEN
from flownav.navigation.progress import LONGEST_AHEAD_S

UNFUSED = "unfused"  # a reason that the session finds (horizon.Serving)
INVALID_FLAG = 2.0  # the flag of `memory.AidMemory`
WITHHELD = {
    "no_vehicle": "no autopilot's HEARTBEAT is received",
    "listening": "the vehicle is being listened to",
    "not_started": "the filter waits for an attitude and a fix or flow",
    "stale": "the newest reading is too old",
    "position_invalid": "no horizontal aid for long: the position is invalid",
    "dead_reckoning": "no horizontal aid for too long",
    "unfused": "a horizontal sensor is received and not fused",
    "fault_suspected": "innovations show that a sensor fails",
    "unprotected": "a sensor that fails unseen may have put the position too far off",
    "origin_doubted": "the autopilot's origin is far from the fixes, and its own position in it is not sent",
    "not_finite": "the estimate is not a finite number",
    "uncertain": "the position's standard deviation is too large",
    "too_fast": "the velocity's standard deviation is too large",
    "uncertain_down": "the height's standard deviation is too large",
    "flow_doubted": "flow contradicts the inertial sensors, and nothing else holds the position",
    "height_doubted": "the range and another height contradict the inertial sensors",
    "begins_in_flight": "it began in flight, and range and autopilot do not agree yet on its height",
    "no_pad": "no pad has been seen",
    "nothing_asked": "--send none",
}
OWN_SYSTEM = 1  # until the vehicle's is known, which we then are of
RELATIVE_S = 1.0  # of dead reckoning, what is stated is how far off it may go in so long
RELATIVE_FLOOR_M = 0.05  # and what differs from one estimate to the next: chosen
STEEPEST_COSINE = 0.1  # cosine of the steepest sight of the pad that is sent, 84 deg: chosen, beyond any camera's view


def why_withheld(on: Running | None, t_s: float, newest_s: float, limits: Limits, base: Base = NOTHING) -> str:
    """Why no estimate of `t_s` may be sent, "" where it may; newest_s: the vehicle's newest reading. See WITHHELD.

    base: what is known to be wrong with the place and is not counted any more.
    """
    if on is None:
        return "listening"
    given, aid, imu = on.given, load_aid(on.work, ONE_LANE, 0), load_imu(on.work, ONE_LANE, 0)
    if load_start(on.work, ONE_LANE, 0).started == 0.0:
        return "not_started"
    imu_stale = given.equipment.use_imu and not on.clock_s - imu.read_s <= given.imu.imu_stale_s
    if imu_stale or not t_s - newest_s <= limits.age_s or not t_s - on.clock_s <= LONGEST_AHEAD_S:
        return "stale"
    if aid.flag >= INVALID_FLAG or on.clock_s - aid.aided_s > given.aid.invalid_s:
        return "position_invalid"
    if t_s - aid.aided_s > limits.dead_reckoning_s:
        return "dead_reckoning"
    if load_flow(on.work, ONE_LANE, 0).doubted > 0.0 and not holds(on):
        return "flow_doubted"
    if on.work[SUSPECTED] > 0.0 and load_suspicion(on.work, ONE_LANE, 0).suspected_s != base.suspected_s:
        return "fault_suspected"
    return "" if on.work[PROTECTION] - base.protection_m <= limits.protection_m else "unprotected"


def estimate_of(
    on: Running,
    now: NowRow[Array],
    t_s: float,
    boot_s: float,
    resets: int,
    offset_ned_m: Vector = (0.0, 0.0, 0.0),
    limits: Limits = Limits(),  # noqa: B008  (frozen)
    base: Base = NOTHING,
) -> say.Estimate:
    """The state of now, which is t_s; boot_s: that on their clock.

    offset_ned_m: of the navigator's origin in the frame that is sent. limits: what `quality` is a share of, less base.
    """
    pose, velocity = _full(now.pose_covariance, 6), np.zeros((6, 6))
    velocity[:3, :3], velocity[3:, 3:] = _full(now.vel_ned_covariance, 3), _full(now.rate_covariance, 3)
    north_m, east_m, down_m = (float(a) + b for a, b in zip(now.pos_ned_m, offset_ned_m, strict=True))
    return say.Estimate(
        max(0, round(boot_s * 1e6)),
        (north_m, east_m, down_m),
        tuple(now.vel_ned_m_s.tolist()),
        tuple(now.quaternion.tolist()),
        tuple(now.rate_frd_rad_s.tolist()) if on.given.equipment.use_imu else (math.nan,) * 3,
        pose,
        velocity,
        resets,
        quality_of(on, pose, velocity, t_s, limits, base),
    )


def tilt_cosine(work: Array) -> float:
    """Cosine of the angle between the vehicle's down and the earth's."""
    return float(rotation_from_quaternion(*map(float, work[QUATERNION : QUATERNION + 4]))[8])


def _full(triangle: Array, count: int) -> Array:
    """A symmetric matrix of its upper triangle, row by row."""
    return np.asarray(triangle[_places(count)] + 0.0)  # no zero with a sign


@cache
def _places(count: int) -> Array:
    """Where each element of a symmetric matrix stands in its upper triangle, row by row; (count, count)."""
    places = np.zeros((count, count), np.int64)
    places[np.triu_indices(count)] = range(count * (count + 1) // 2)
    return np.asarray(np.maximum(places, places.T))


def quality_of(on: Running, pose: Array, velocity: Array, t_s: float, limits: Limits, base: Base = NOTHING) -> int:
    """1 to 100 percent: what is left to the nearest limit of position, velocity, protection and time without aid.

    ArduPilot takes neither the velocity's covariance nor a protection level; this it does take (VISO_QUAL_MIN).
    """
    used = (
        math.sqrt(max(pose[0, 0] - base.variance_m2, pose[1, 1] - base.variance_m2, 0.0)) / limits.sigma_m,
        math.sqrt(max(velocity[0, 0], velocity[1, 1], 0.0)) / limits.sigma_m_s,
        (float(on.work[PROTECTION]) - base.protection_m) / limits.protection_m,
        (t_s - load_aid(on.work, ONE_LANE, 0).aided_s) / limits.dead_reckoning_s,
    )
    worst = max(share if math.isfinite(share) else 1.0 for share in used)
    return max(1, min(100, round(100.0 * (1.0 - worst))))


def fault_of(estimate: say.Estimate, limits: Limits, base: Base = NOTHING) -> str:
    """Why the estimate itself must not be sent: `not_finite`, `too_fast`, `uncertain_down`, `uncertain`, or ""."""
    assert estimate.pose_covariance is not None
    assert estimate.velocity_covariance is not None
    pose, velocity = estimate.pose_covariance.diagonal().tolist(), estimate.velocity_covariance.diagonal().tolist()
    numbers = (*estimate.pos_ned_m, *estimate.vel_ned_m_s, *estimate.quaternion, *pose, *velocity)
    if not all(map(math.isfinite, numbers)):
        return "not_finite"
    if max(velocity[:3]) > limits.sigma_m_s**2:
        return "too_fast"
    if pose[2] > limits.sigma_down_m**2:
        return "uncertain_down"
    return "uncertain" if max(pose[0], pose[1]) - base.variance_m2 > limits.sigma_m**2 else ""


def as_relative(estimate: say.Estimate) -> say.Estimate:
    """The accuracy of a dead-reckoned place relative to the place of a second ago.

    The error since the start is the autopilot's as well, which follows this place and has no other. If
    the whole of it were stated, its filter would take the place for bad, follow the velocity, and drift by itself.
    """
    assert estimate.pose_covariance is not None
    assert estimate.velocity_covariance is not None
    pose = estimate.pose_covariance.copy()
    pose[:3, :3] = RELATIVE_S**2 * estimate.velocity_covariance[:3, :3] + RELATIVE_FLOOR_M**2 * np.eye(3)
    pose[:3, 3:] = pose[3:, :3] = 0.0
    return estimate._replace(pose_covariance=pose)


class Answers:
    """Frames to send, packed and, with a key, signed."""

    def __init__(self, options: Options) -> None:
        self._options = options
        self._mav: Any = coder(OWN_SYSTEM, say.ODOMETRY_COMPONENT)

    @property
    def mav(self) -> Any:
        """The packer."""
        return self._mav

    def of_system(self, vehicle: Vehicle) -> None:
        """We are a component of the vehicle's system."""
        self._mav.srcSystem = vehicle.system

    def packed(self, message: Message, unix_s: float) -> bytes:
        """A frame."""
        if self._options.key is not None:
            sign_outgoing(self._mav, self._options.key, unix_s)
        return bytes(message.pack(self._mav))

    def timesync(self, now_s: float) -> Message:
        """A request, with our time."""
        return self._mav.timesync_encode(0, round(now_s * 1e9))

    def timesync_answer(self, request: Message, boot_s: float) -> Message:
        """PX4 and ArduPilot lay the stamps of what we send by this: they are of the vehicle's own clock."""
        return self._mav.timesync_encode(round(boot_s * 1e9), request.ts1)

    def velocity(self, vehicle: Vehicle, estimate: say.Estimate) -> list[Message]:
        """The velocity alone, where the place is not known; ArduPilot has a message for it."""
        if self._options.send not in ("odometry", "vision"):
            return []
        if vehicle.make == PX4 and self._options.send == "odometry":
            nowhere = estimate._replace(pos_ned_m=(math.nan,) * 3, pose_covariance=None)
            return [say.odometry(self._mav, nowhere, frame=LOCAL_NED)]
        return [say.vision_speed_estimate(self._mav, estimate)]

    def estimates(
        self, vehicle: Vehicle, estimate: say.Estimate, on: Running, offset_ned_m: Vector = (0.0, 0.0, 0.0)
    ) -> list[Message]:
        """The estimate as `--send` asks; none where the pad is asked for and not known.

        offset_ned_m: of the navigator's origin, which the pad's place is about, in the estimate's frame.
        """
        send = self._options.send
        if not holds(on):
            estimate = as_relative(estimate)
        if send == "odometry":
            return [say.odometry(self._mav, estimate, frame=LOCAL_NED if vehicle.make == PX4 else LOCAL_FRD)]
        if send == "vision":
            return [say.vision_position_estimate(self._mav, estimate), say.vision_speed_estimate(self._mav, estimate)]
        if on.work[PAD_KNOWN] != SEEN:  # the place of take-off is not what a camera lands on
            return []
        pad = [float(value) for value in on.work[STATE + PAD : STATE + PAD + 3]]
        place = pad[0] + offset_ned_m[0], pad[1] + offset_ned_m[1], pad[2] + offset_ned_m[2]
        north, east, down = (place[i] - estimate.pos_ned_m[i] for i in range(3))
        x, y, z = to_body(rotation_from_quaternion(*estimate.quaternion), north, east, down)
        distance_m = math.sqrt(x * x + y * y + z * z)
        if not z > STEEPEST_COSINE * distance_m:
            return []
        in_earth = place if vehicle.make == PX4 else None
        return [say.landing_target(self._mav, estimate.time_us, x / z, y / z, distance_m, pad_ned_m=in_earth)]
