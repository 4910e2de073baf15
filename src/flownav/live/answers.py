"""What is said to a vehicle: heartbeats, TIMESYNC, requests, and the estimate in the messages that were asked for."""

from __future__ import annotations

import math
from typing import Any

from flownav.core.frames import Vector, rotation_from_quaternion, to_body
from flownav.estimation.states import PAD, STATE
from flownav.live.options import Options
from flownav.live.reception import Vehicle
from flownav.mavlink.dialect import INVALID_AUTOPILOT, PX4, Message, coder
from flownav.mavlink.outgoing import Estimate, landing_target, odometry, vision_position_estimate, vision_speed_estimate
from flownav.mavlink.position_messages import LOCAL_FRD, LOCAL_NED
from flownav.mavlink.sensors_outgoing import MAVLINK_VERSION
from flownav.mavlink.signing import sign_outgoing
from flownav.navigation.loop import Running
from flownav.navigation.memory import PAD_KNOWN
from flownav.navigation.place import SEEN

ONBOARD_CONTROLLER, ACTIVE = 18, 4  # MAV_TYPE, MAV_STATE
ODOMETRY_COMPONENT = 197  # MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY
OWN_SYSTEM = 1  # until the vehicle's is known, which we then are of
STEEPEST = 0.1  # cosine of the steepest sight of the pad that is told


class Answers:
    """Frames to send, packed and, with a key, signed."""

    def __init__(self, options: Options) -> None:
        self._options = options
        self._mav: Any = coder(OWN_SYSTEM, ODOMETRY_COMPONENT)

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

    def heartbeat(self) -> Message:
        """Of a companion computer."""
        return self._mav.heartbeat_encode(ONBOARD_CONTROLLER, INVALID_AUTOPILOT, 0, 0, ACTIVE, MAVLINK_VERSION)

    def timesync(self, now_s: float) -> Message:
        """A request, with our time."""
        return self._mav.timesync_encode(0, round(now_s * 1e9))

    def timesync_answer(self, request: Message, boot_s: float) -> Message:
        """PX4 and ArduPilot lay the stamps of what we send by this: they are of the vehicle's own clock."""
        return self._mav.timesync_encode(round(boot_s * 1e9), request.ts1)

    def estimates(
        self, vehicle: Vehicle, estimate: Estimate, on: Running, offset_ned_m: Vector = (0.0, 0.0, 0.0)
    ) -> list[Message]:
        """The estimate as `--send` asks; none where the pad is asked for and not known.

        offset_ned_m: of the navigator's origin, which the pad's place is about, in the estimate's frame.
        """
        send = self._options.send
        if send == "odometry":
            return [odometry(self._mav, estimate, frame=LOCAL_NED if vehicle.make == PX4 else LOCAL_FRD)]
        if send == "vision":
            return [vision_position_estimate(self._mav, estimate), vision_speed_estimate(self._mav, estimate)]
        if on.work[PAD_KNOWN] != SEEN:  # the place of take-off is not what a camera lands on
            return []
        pad = [float(value) for value in on.work[STATE + PAD : STATE + PAD + 3]]
        place = pad[0] + offset_ned_m[0], pad[1] + offset_ned_m[1], pad[2] + offset_ned_m[2]
        north, east, down = (place[i] - estimate.pos_ned_m[i] for i in range(3))
        x, y, z = to_body(rotation_from_quaternion(*estimate.quaternion), north, east, down)
        distance_m = math.sqrt(x * x + y * y + z * z)
        if not z > STEEPEST * distance_m:
            return []
        in_earth = place if vehicle.make == PX4 else None
        return [landing_target(self._mav, estimate.time_us, x / z, y / z, distance_m, pad_ned_m=in_earth)]
