"""A flight with its motion and the verdict on the sensor's axes: where an identification and a first look begin."""

from __future__ import annotations

from typing import NamedTuple

from flownav.core.measurement import Array
from flownav.lab.identification.flight import Flight, flight
from flownav.lab.identification.reference_motion import Motion, motion, velocity_response
from flownav.lab.identification.sentinel import Axes, judge
from flownav.logs.log import Log


class Judged(NamedTuple):
    """The flight, its motion by the reference, the flow's response to it (2, 2), and what that says of the axes."""

    flown: Flight
    moved: Motion
    response: Array
    axes: Axes


def judged(log: Log, reference: str = "auto") -> Judged:
    """The verdict on a log. InputError names what it lacks.

    An attitude that the navigator found with flow of the wrong sign is wrong itself, and so is the rotation that was
    taken out of such a flow: both are done again with the flow put right.
    """
    found = _judged(flight(log, reference))
    if found.axes.right or not found.axes.clear or not found.flown.attitude_is_own:
        return found
    again = _judged(flight(log, reference, found.axes.assignment))
    return again if again.axes.clear else found


def _judged(flown: Flight) -> Judged:
    moved = motion(flown)
    tie = moved.flow_tie
    age_s = tie.delay_s.value if tie is not None and tie.holds else flown.age_s
    response = velocity_response(flown, moved, age_s)
    return Judged(flown, moved, response, judge(response, moved.yaw_known))
