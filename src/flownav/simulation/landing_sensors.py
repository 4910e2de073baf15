"""The sensors of a landing on lanes: the pad camera and the skid switch, into the ring (`sampling`)."""

from __future__ import annotations

import numpy as np

from flownav.compile import Lanes, Work, equation, procedure, replacing
from flownav.control.autopilot import AutopilotState
from flownav.control.go_around import Knowledge
from flownav.frames import rotation_from_quaternion
from flownav.navigation.records import Reading
from flownav.optics.shutter import image_rate_rad_s
from flownav.sensors.pad_camera import read_pad_camera, stated_fix
from flownav.sensors.skid_switch import step_skid_switch
from flownav.simulation import layout
from flownav.simulation.draws import (
    PAD_CHANNEL,
    SKID_CHANNEL,
    draw,
)
from flownav.simulation.layout import (
    PLANT,
    late_as_is,
    load_autopilot,
    load_helicopter,
    load_loads,
    load_pad_normals,
    load_pad_unit,
    load_skid,
    load_skid_normals,
    load_skid_unit,
    pad_as_is,
    skid_as_is,
    store_skid,
)
from flownav.simulation.onboard import (
    LEAST_HEIGHT_M,
    PAD_SEEN,
    SETTLED_S,
    Onboard,
    earlier,
    place_of,
)
from flownav.simulation.records import Landed
from flownav.simulation.ring import put_slot, reading_of

_, store_landed = PLANT.access(Landed)
with_unseen = replacing(Knowledge, "pad_unseen_s")


@procedure
def read_pad(work: Work, lanes: Lanes, seed: int, flight: int, epoch: int, slot: int, s: Onboard) -> None:
    """A fix of the pad: by the model, or what was seen in this frame where the flight's frames were rendered."""
    seen = (epoch - s.pad_clock.first) // s.pad_clock.every * PAD_SEEN
    draw(work, lanes, layout.PAD_NORMALS, 8, seed, flight, epoch, PAD_CHANNEL)
    for lane in range(len(lanes)):
        state = earlier(load_helicopter(work, lanes, lane), late_as_is(work, lanes, lane).pad_s)
        rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
        north, east, down = place_of(state, s.pad_place)
        above = -down if -down > LEAST_HEIGHT_M else LEAST_HEIGHT_M
        ahead, aside = image_rate_rad_s(state.u, state.v, state.p, state.q, above)
        rate = np.sqrt(ahead * ahead + aside * aside)
        fix = read_pad_camera(
            load_pad_unit(work, lanes, lane), north, east, down, rotation, rate,
            load_pad_normals(work, lanes, lane), pad_as_is(work, lanes, lane), s.pad,
        )  # fmt: skip
        if seen + PAD_SEEN <= len(s.pad_seen):
            shown_m = s.pad_seen[seen + 3]
            fix = stated_fix(
                load_pad_unit(work, lanes, lane), s.pad_seen[seen], s.pad_seen[seen + 1], s.pad_seen[seen + 2],
                1.0 if shown_m > 0.0 else 0.0, shown_m, rate, s.pad,
            )  # fmt: skip
        reading = reading_of(
            fix.tan_forward, fix.tan_right, fix.distance_m, fix.forward_variance, fix.right_variance,
            fix.distance_variance_m2, fix.quality, fix.arrived,
        )  # fmt: skip
        put_slot(work, lanes, slot, lane, reading)


@PLANT.on_lanes
def note_seen(known: Knowledge, reading: Reading) -> Knowledge:
    """Whether the camera saw the pad in the frame that is in a slot now."""
    return with_unseen(known, pad_unseen_s=0.0 if reading.arrived > 0.0 else known.pad_unseen_s)


@procedure
def read_skid(work: Work, lanes: Lanes, seed: int, flight: int, epoch: int, slot: int, s: Onboard) -> None:
    """The skid switch, and what the vehicle says of it: on the ground, not about to fly, and settled."""
    draw(work, lanes, layout.SKID_NORMALS, 2, seed, flight, epoch, SKID_CHANNEL)
    for lane in range(len(lanes)):
        load_n = load_loads(work, lanes, lane).contact_n
        after, read = step_skid_switch(
            load_skid(work, lanes, lane), load_skid_unit(work, lanes, lane), load_n,
            load_skid_normals(work, lanes, lane), skid_as_is(work, lanes, lane),
        )  # fmt: skip
        store_skid(work, lanes, lane, after)
        store_landed(work, lanes, lane, Landed(read.landed))
        landed = 1.0 if at_rest(read.landed, load_autopilot(work, lanes, lane)) else 0.0
        reading = reading_of(landed, 0.0, 0.0, np.nan, np.nan, np.nan, read.quality, read.arrived)
        put_slot(work, lanes, slot, lane, reading)


@equation
def at_rest(switch: float, autopilot: AutopilotState) -> bool:
    """The switch is closed, the autopilot does not fly, and after a landing the skids have taken the weight."""
    settled = autopilot.contact_time_s == 0.0 or autopilot.contact_time_s > SETTLED_S
    return switch > 0.5 and autopilot.flying == 0.0 and settled
