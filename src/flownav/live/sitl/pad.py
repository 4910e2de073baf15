"""A camera that a simulator lacks: looks down at a pad where the vehicle took off, and sends it as LANDING_TARGET."""

import math
import random

from flownav.core.frames import rotation_from_quaternion, to_body
from flownav.live.sitl.wire import Wire
from flownav.logs.mavlink import outgoing as say
from flownav.logs.mavlink.framing import coder
from flownav.logs.mavlink.messages import TrueState
from flownav.logs.mavlink.position_messages import local_position_m

COMPONENT = 100  # MAV_COMP_ID_CAMERA
EVERY_S = 0.1
WIDEST = 0.5  # tangent of half the field of view
NEAREST_M = 0.25  # nearer, the pad fills the picture
ANGLE_NOISE, DISTANCE_NOISE = 0.005, 0.02  # of a tangent; of the distance


class PadCamera:
    """Sends the pad, ten times a second, while it is in sight: angles and distance."""

    def __init__(self, wire: Wire, system: int, seed: int) -> None:
        self._wire, self._mav = wire, coder(system, COMPONENT)
        self._chance = random.Random(seed)
        self._pad: tuple[float, float, float] | None = None
        self._sent_s = float("-inf")
        wire.turns.append(self.turn)

    def turn(self, now_s: float) -> None:
        """Send the pad where a picture is due and shows it."""
        truth = self._wire.history.truth
        if not truth or now_s - self._sent_s < EVERY_S:
            return
        self._sent_s, state = now_s, truth[-1].state
        self._pad = self._pad or state.position_deg_m
        sight = sighted(state, self._pad)
        if sight is None:
            return
        forward, right, distance_m = sight
        time_us = round((truth[-1].now_s + self._wire.history.boot_less_now_s) * 1e6)
        forward, right = (tangent + self._chance.gauss(0.0, ANGLE_NOISE) for tangent in (forward, right))
        distance_m *= 1.0 + self._chance.gauss(0.0, DISTANCE_NOISE)
        self._wire.say(say.landing_target(self._mav, max(time_us, 0), forward, right, distance_m), self._mav)


def sighted(state: TrueState, pad_deg_m: tuple[float, float, float]) -> tuple[float, float, float] | None:
    """Tangents forward and right of a pad and its distance [m]; None where it is out of the picture."""
    rotation = rotation_from_quaternion(*state.quaternion)
    forward, right, down = to_body(rotation, *local_position_m(pad_deg_m, state.position_deg_m))
    if down < NEAREST_M or max(abs(forward), abs(right)) > WIDEST * down:
        return None
    return float(forward / down), float(right / down), math.hypot(forward, right, down)
