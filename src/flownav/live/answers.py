"""The estimate of now, whether it may be sent, and what is said to a vehicle."""

import math
from typing import Any

import numpy as np

from flownav.core.compile import ONE_LANE
from flownav.core.frames import Vector, heading_from_quaternion, rotation_from_quaternion, to_body
from flownav.core.measurement import Array
from flownav.estimation.states import ATTITUDE, GYRO_BIAS, PAD, POSITION, STATE, VELOCITY
from flownav.live.options import Limits, Options
from flownav.live.reception import Vehicle
from flownav.logs.mavlink import outgoing as say
from flownav.logs.mavlink.framing import PX4, Message, coder
from flownav.logs.mavlink.position_messages import LOCAL_FRD, LOCAL_NED
from flownav.logs.mavlink.signing import sign_outgoing
from flownav.navigation.ahead import covariance_at, state_at
from flownav.navigation.loop import Running
from flownav.navigation.memory import PAD_KNOWN, PROTECTION, SUSPECTED, load_aid, load_imu, load_start
from flownav.navigation.place import SEEN

LONGEST_AHEAD_S = 2.0  # chosen: twice the longest horizon, within the inertial readings that are kept
UNFUSED = "unfused"  # a reason that the session finds (horizon.Serving)
INVALID_FLAG = 2.0  # the flag of `memory.AidMemory`
WITHHELD = {
    "no_vehicle": "no autopilot's HEARTBEAT is heard",
    "listening": "the vehicle is being listened to",
    "not_started": "the filter waits for an attitude and a fix or flow",
    "stale": "the newest reading is too old",
    "position_invalid": "no horizontal aid for long: the position is invalid",
    "dead_reckoning": "no horizontal aid for too long",
    "unfused": "a horizontal sensor is heard and not fused",
    "fault_suspected": "innovations tell of a sensor that fails",
    "unprotected": "a sensor that fails unseen may have put the position too far off",
    "not_finite": "the estimate is not a finite number",
    "uncertain": "the estimate's standard deviation is too large",
    "no_pad": "no pad has been seen",
    "nothing_asked": "--send none",
}
OWN_SYSTEM = 1  # until the vehicle's is known, which we then are of
STEEPEST_COSINE = 0.1  # cosine of the steepest sight of the pad that is told, 84 deg: chosen, beyond any camera's view


def why_withheld(on: Running | None, t_s: float, newest_s: float, limits: Limits) -> str:
    """Why no estimate of `t_s` may be sent, "" where it may; newest_s: the vehicle's newest reading. See WITHHELD."""
    if on is None:
        return "listening"
    told, aid, imu = on.told, load_aid(on.work, ONE_LANE, 0), load_imu(on.work, ONE_LANE, 0)
    if load_start(on.work, ONE_LANE, 0).started == 0.0:
        return "not_started"
    imu_stale = told.equipment.use_imu and not on.clock_s - imu.read_s <= told.imu.imu_stale_s
    if imu_stale or not t_s - newest_s <= limits.age_s or not t_s - on.clock_s <= LONGEST_AHEAD_S:
        return "stale"
    if aid.flag >= INVALID_FLAG or on.clock_s - aid.aided_s > told.aid.invalid_s:
        return "position_invalid"
    if t_s - aid.aided_s > limits.dead_reckoning_s:
        return "dead_reckoning"
    if on.work[SUSPECTED] > 0.0:
        return "fault_suspected"
    return "" if on.work[PROTECTION] <= limits.protection_m else "unprotected"


def estimate_of(
    on: Running,
    imu: Array,
    t_s: float,
    boot_s: float,
    resets: int,
    offset_ned_m: Vector = (0.0, 0.0, 0.0),
    limits: Limits = Limits(),  # noqa: B008  (frozen)
) -> say.Estimate:
    """The state carried on to t_s. imu (n, 7): readings later than the filter's clock. boot_s: t_s on their clock.

    offset_ned_m: of the navigator's origin in the frame that is sent. limits: what `quality` is a share of.
    """
    state = [float(value) for value in state_at(on.work, on.settings, imu, t_s)]
    covariance = covariance_at(on.work, t_s, on.told.filter.position_walk_m_rt_s)
    pose, velocity = _sent(covariance, heading_from_quaternion(*state[6:10]))
    if not on.told.equipment.use_imu:
        state[10:13] = [float("nan")] * 3
    north_m, east_m, down_m = offset_ned_m
    return say.Estimate(
        max(0, round(boot_s * 1e6)),
        (state[0] + north_m, state[1] + east_m, state[2] + down_m),
        (state[3], state[4], state[5]),
        (state[6], state[7], state[8], state[9]),
        (state[10], state[11], state[12]),
        pose,
        velocity,
        resets,
        quality_of(on, pose, velocity, t_s, limits),
    )


def quality_of(on: Running, pose: Array, velocity: Array, t_s: float, limits: Limits) -> int:
    """1 to 100 percent: what is left to the nearest limit of position, velocity, protection and time without aid.

    ArduPilot takes neither the velocity's covariance nor a protection level; this it does take (VISO_QUAL_MIN).
    """
    used = (
        math.sqrt(max(pose[0, 0], pose[1, 1], 0.0)) / limits.sigma_m,
        math.sqrt(max(velocity[0, 0], velocity[1, 1], 0.0)) / limits.sigma_m_s,
        float(on.work[PROTECTION]) / limits.protection_m,
        (t_s - load_aid(on.work, ONE_LANE, 0).aided_s) / limits.dead_reckoning_s,
    )
    worst = max(share if math.isfinite(share) else 1.0 for share in used)
    return max(1, min(100, round(100.0 * (1.0 - worst))))


def fault_of(estimate: say.Estimate, limits: Limits) -> str:
    """What is wrong with an estimate itself: `not_finite`, `uncertain`, or ""."""
    assert estimate.pose_covariance is not None
    assert estimate.velocity_covariance is not None
    pose, velocity = np.diag(estimate.pose_covariance), np.diag(estimate.velocity_covariance)
    numbers = (*estimate.pos_ned_m, *estimate.vel_ned_m_s, *estimate.quaternion)
    if not (np.isfinite(numbers).all() and np.isfinite(pose).all() and np.isfinite(velocity).all()):
        return "not_finite"
    if max(pose[0], pose[1]) > limits.sigma_m**2 or max(velocity[0], velocity[1]) > limits.sigma_m_s**2:
        return "uncertain"
    return ""


def _sent(covariance: Array, heading_rad: float) -> tuple[Array, Array]:
    """Covariances of the pose (north, east, down, roll, pitch, yaw) and of the velocity (NED, body rates).

    A small rotation of the level body about the earth's axes is one of roll and pitch turned by the heading.
    """
    turn = np.eye(6)
    cosine, sine = math.cos(heading_rad), math.sin(heading_rad)
    turn[3:5, 3:5] = [[cosine, sine], [-sine, cosine]]
    places = [*range(POSITION, POSITION + 3), *range(ATTITUDE, ATTITUDE + 3)]
    pose = turn @ covariance[np.ix_(places, places)] @ turn.T
    velocity = np.zeros((6, 6))
    velocity[:3, :3] = covariance[VELOCITY : VELOCITY + 3, VELOCITY : VELOCITY + 3]
    velocity[3:, 3:] = covariance[GYRO_BIAS : GYRO_BIAS + 3, GYRO_BIAS : GYRO_BIAS + 3]
    return pose, velocity


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

    def estimates(
        self, vehicle: Vehicle, estimate: say.Estimate, on: Running, offset_ned_m: Vector = (0.0, 0.0, 0.0)
    ) -> list[Message]:
        """The estimate as `--send` asks; none where the pad is asked for and not known.

        offset_ned_m: of the navigator's origin, which the pad's place is about, in the estimate's frame.
        """
        send = self._options.send
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
