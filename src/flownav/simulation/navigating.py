"""The navigator's turn in each epoch: what is due goes in, its estimate is carried on to now and flown on.

The simulator writes readings into the rows that the navigator takes them from, and reads what it says; it never
touches the filter.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.compile import Lanes, Work, equation, invoke, larger, procedure
from flownav.control.go_around import Knowledge
from flownav.control.guidance import Reference
from flownav.estimation.covariance import covariance_of, variance_of
from flownav.estimation.states import GROUND, PAD, POSITION, QUATERNION, STATE, VELOCITY
from flownav.frames import quaternion_product, rotation_from_quaternion, to_body, to_earth
from flownav.navigation.ahead import carried, coasted, state_of
from flownav.navigation.memory import PAD_KNOWN, READING, SUSPECTED, load_ground, load_start
from flownav.navigation.rows import body_velocity_variance
from flownav.navigation.tape import Output
from flownav.simulation import layout
from flownav.simulation.layout import load_helicopter, load_known, store_known
from flownav.simulation.ring import FIELDS, FIRST, hand_over

EPOCH_S = 0.02
SCORED = 6
TRUTH = 10  # rows of the truth at an instant: position and velocity NED, quaternion


class Timetable(NamedTuple):
    """`schedule.Schedule` as kernels take it, and where the truth of the last instants lies in the lane buffer."""

    t_s: NDArray[np.float64]
    sensor: NDArray[np.int64]
    slot: NDArray[np.int64]
    epoch: NDArray[np.int64]
    slots: int
    horizon_epochs: int
    readings: int


@equation
def first_truth(table: Timetable) -> int:
    """The first row of the remembered truths, behind the ring."""
    return FIRST + table.slots * FIELDS


@equation
def first_inertial(table: Timetable) -> int:
    """The first row of the remembered inertial readings, behind the truths."""
    return first_truth(table) + (table.horizon_epochs + 1) * TRUTH


@equation
def feed_due(
    work: Work, nav: Work, lanes: Lanes, epoch: int, following: int, take: Any, settings: Work, o: Output, fed: Work,
    table: Timetable,
) -> int:  # fmt: skip
    """Every reading that is due in this epoch, in order; the next one's number. fed: a copy, where there is room."""
    while following < table.readings and table.epoch[following] <= epoch:
        hand_over(work, nav, lanes, table.slot[following])
        if o.room[5] > following:
            for i in range(FIELDS):
                for lane in range(len(lanes)):
                    value = nav[(READING + i) * len(lanes) + lane]
                    fed[(following * FIELDS + i) * len(lanes) + lane] = value
        invoke(
            take, nav, settings, o.estimate, o.innovation, o.event, o.entry, o.state, o.covariance, o.room, o.used,
            table.t_s[following], table.sensor[following],
        )  # fmt: skip
        following += 1
    return following


# -- the truth at the horizon -----------------------------------------------------------------------------------
@procedure
def note_truth(work: Work, lanes: Lanes, epoch: int, table: Timetable) -> None:
    """Remember the truth of this instant for as long as the horizon is."""
    row = first_truth(table) + (epoch % (table.horizon_epochs + 1)) * TRUTH
    for lane in range(len(lanes)):
        state = load_helicopter(work, lanes, lane)
        rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
        vel_n, vel_e, vel_d = to_earth(rotation, state.u, state.v, state.w)
        work[row * len(lanes) + lane] = state.pos_n
        work[(row + 1) * len(lanes) + lane] = state.pos_e
        work[(row + 2) * len(lanes) + lane] = state.pos_d
        work[(row + 3) * len(lanes) + lane] = vel_n
        work[(row + 4) * len(lanes) + lane] = vel_e
        work[(row + 5) * len(lanes) + lane] = vel_d
        work[(row + 6) * len(lanes) + lane] = state.qw
        work[(row + 7) * len(lanes) + lane] = state.qx
        work[(row + 8) * len(lanes) + lane] = state.qy
        work[(row + 9) * len(lanes) + lane] = state.qz


@procedure
def compare_at_horizon(work: Work, nav: Work, lanes: Lanes, epoch: int, table: Timetable) -> None:
    """Errors of the navigator where it stands, their variances, and e' P^-1 e of position and velocity NED."""
    then = epoch - table.horizon_epochs
    row = first_truth(table) + (then % (table.horizon_epochs + 1)) * TRUTH
    for lane in range(len(lanes)):
        running = load_start(nav, lanes, lane).started > 0.0 and then >= 0
        q = (
            nav[QUATERNION * len(lanes) + lane], nav[(QUATERNION + 1) * len(lanes) + lane],
            nav[(QUATERNION + 2) * len(lanes) + lane], nav[(QUATERNION + 3) * len(lanes) + lane],
        )  # fmt: skip
        own = rotation_from_quaternion(q[0], q[1], q[2], q[3])
        true = rotation_from_quaternion(
            work[(row + 6) * len(lanes) + lane], work[(row + 7) * len(lanes) + lane],
            work[(row + 8) * len(lanes) + lane], work[(row + 9) * len(lanes) + lane],
        )  # fmt: skip
        v = STATE + VELOCITY
        said = to_body(
            own, nav[v * len(lanes) + lane], nav[(v + 1) * len(lanes) + lane], nav[(v + 2) * len(lanes) + lane]
        )
        was = to_body(
            true, work[(row + 3) * len(lanes) + lane], work[(row + 4) * len(lanes) + lane],
            work[(row + 5) * len(lanes) + lane],
        )  # fmt: skip
        for i in range(3):
            error = nav[(STATE + POSITION + i) * len(lanes) + lane] - work[(row + i) * len(lanes) + lane]
            work[(layout.HORIZON_ERROR + i) * len(lanes) + lane] = error if running else np.nan
            work[(layout.HORIZON_ERROR + 3 + i) * len(lanes) + lane] = said[i] - was[i] if running else np.nan
            work[(layout.VARIANCE + i) * len(lanes) + lane] = variance_of(nav, lanes, POSITION + i, lane)
            variance = body_velocity_variance(nav, lanes, lane, own[i], own[3 + i], own[6 + i])
            work[(layout.VARIANCE + 3 + i) * len(lanes) + lane] = variance
        nees = normalised_error(work, nav, lanes, lane, row)
        work[layout.NEES * len(lanes) + lane] = nees if running else np.nan


@equation
def normalised_error(work: Work, nav: Work, lanes: Lanes, lane: int, row: int) -> float:
    """e' P^-1 e of one lane's position and velocity NED, by elimination in the rows of SCRATCH."""
    error = layout.ELIMINATION
    square = error + SCORED
    for i in range(SCORED):
        e = nav[(STATE + i) * len(lanes) + lane] - work[(row + i) * len(lanes) + lane]
        work[(error + i) * len(lanes) + lane] = e
        for j in range(SCORED):
            work[(square + i * SCORED + j) * len(lanes) + lane] = covariance_of(nav, lanes, i, j, lane)
    total = 0.0
    for k in range(SCORED):
        pivot = work[(square + k * (SCORED + 1)) * len(lanes) + lane]
        e = work[(error + k) * len(lanes) + lane]
        total += e * e / pivot
        for i in range(k + 1, SCORED):
            share = work[(square + i * SCORED + k) * len(lanes) + lane] / pivot
            work[(error + i) * len(lanes) + lane] -= share * e
            for j in range(k + 1, SCORED):
                taken = share * work[(square + k * SCORED + j) * len(lanes) + lane]
                work[(square + i * SCORED + j) * len(lanes) + lane] -= taken
    return total


@procedure
def put_on_truth(work: Work, nav: Work, lanes: Lanes, epoch: int, table: Timetable) -> None:
    """The navigator's position, velocity and attitude become the truth at its horizon, for Jacobians to be taken there.

    Its covariance is then that of the posterior Cramér-Rao bound along this flight (`estimation.bound`), for its model.
    """
    then = epoch - table.horizon_epochs
    row = first_truth(table) + (then % (table.horizon_epochs + 1)) * TRUTH
    for lane in range(len(lanes)):
        running = load_start(nav, lanes, lane).started > 0.0 and then >= 0
        for i in range(6):
            true = work[(row + i) * len(lanes) + lane]
            said = nav[(STATE + i) * len(lanes) + lane]
            nav[(STATE + i) * len(lanes) + lane] = true if running else said
        for i in range(4):
            true = work[(row + 6 + i) * len(lanes) + lane]
            said = nav[(QUATERNION + i) * len(lanes) + lane]
            nav[(QUATERNION + i) * len(lanes) + lane] = true if running else said


# -- from the horizon to now --------------------------------------------------------------------------------------
@procedure
def carry_ahead(work: Work, nav: Work, lanes: Lanes, heard: int, ahead: int, period_s: float, table: Timetable) -> None:
    """ESTIMATED and its attitude: the navigator's state moved on by the newest `ahead` inertial readings, of `heard`.

    Position is counted from where the vehicle takes its pad to be (PLACE): a camera's pad, else what it noted; its
    height over the ground that a range has found.
    """
    first, kept = first_inertial(table), kept_inertials(table, period_s)
    for lane in range(len(lanes)):
        c = state_of(nav, lanes, lane)
        for k in range(heard - ahead, heard):
            row = first + 6 * (k % kept)
            between = (
                work[row * len(lanes) + lane], work[(row + 1) * len(lanes) + lane], work[(row + 2) * len(lanes) + lane],
                work[(row + 3) * len(lanes) + lane], work[(row + 4) * len(lanes) + lane],
                work[(row + 5) * len(lanes) + lane],
            )  # fmt: skip
            heard_it = np.isfinite(between[0] + between[3])
            c = carried(c, between, period_s) if heard_it else coasted(c, period_s)
        find_place(work, nav, lanes, lane)
        u, v, w = to_body(rotation_from_quaternion(c.qw, c.qx, c.qy, c.qz), c.vel_n, c.vel_e, c.vel_d)
        said = (c.pos_n, c.pos_e, c.pos_d, u, v, w)
        for i in range(6):
            place = work[(layout.PLACE + i) * len(lanes) + lane] if i < 3 else 0.0
            put(work, lanes, lane, layout.ESTIMATED + i, said[i] - place)
        put(work, lanes, lane, layout.ESTIMATED_ATTITUDE, c.qw)
        put(work, lanes, lane, layout.ESTIMATED_ATTITUDE + 1, c.qx)
        put(work, lanes, lane, layout.ESTIMATED_ATTITUDE + 2, c.qy)
        put(work, lanes, lane, layout.ESTIMATED_ATTITUDE + 3, c.qz)


@equation
def find_place(work: Work, nav: Work, lanes: Lanes, lane: int) -> None:
    """PLACE by the pad's camera and by the range, where they have told."""
    known = nav[PAD_KNOWN * len(lanes) + lane] > 0.0
    grounded = load_ground(nav, lanes, lane).known > 0.0
    row = layout.PLACE
    north, east = work[row * len(lanes) + lane], work[(row + 1) * len(lanes) + lane]
    down = work[(row + 2) * len(lanes) + lane]
    put(work, lanes, lane, row, nav[(STATE + PAD) * len(lanes) + lane] if known else north)
    put(work, lanes, lane, row + 1, nav[(STATE + PAD + 1) * len(lanes) + lane] if known else east)
    put(work, lanes, lane, row + 2, nav[(STATE + GROUND) * len(lanes) + lane] if grounded else down)


@procedure
def note_knowledge(work: Work, nav: Work, lanes: Lanes) -> None:
    """What the vehicle knows of its landing, by its navigator and its camera, an epoch later."""
    for lane in range(len(lanes)):
        found, suspects = nav[PAD_KNOWN * len(lanes) + lane] > 0.0, nav[SUSPECTED * len(lanes) + lane] > 0.0
        north, east = over_pad(nav, lanes, lane, 0, found), over_pad(nav, lanes, lane, 1, found)
        sigma_m = np.sqrt(larger(larger(north, east), 0.0)) if np.isfinite(north + east) else np.inf
        unseen_s = load_known(work, lanes, lane).pad_unseen_s + EPOCH_S
        grounded = load_ground(nav, lanes, lane).known
        now = Knowledge(1.0 if found else 0.0, grounded, unseen_s, sigma_m, 1.0 if suspects else 0.0)
        store_known(work, lanes, lane, now)


@equation
def over_pad(nav: Work, lanes: Lanes, lane: int, axis: int, found: bool) -> float:
    """Variance of the position over the pad along north (0) or east (1); over the filter's origin before."""
    own = variance_of(nav, lanes, POSITION + axis, lane)
    pad = variance_of(nav, lanes, PAD + axis, lane) - 2.0 * covariance_of(nav, lanes, POSITION + axis, PAD + axis, lane)
    return own + pad if found else own


@equation
def kept_inertials(table: Timetable, period_s: float) -> int:
    """How many inertial readings are remembered."""
    return int(np.rint(table.horizon_epochs * EPOCH_S / period_s)) + 1


@equation
def keep_inertial(work: Work, lanes: Lanes, slot: int, heard: int, period_s: float, table: Timetable) -> None:
    """Remember the reading that was just put into a slot, the `heard`-th."""
    row = first_inertial(table) + 6 * (heard % kept_inertials(table, period_s))
    for i in range(6):
        for lane in range(len(lanes)):
            work[(row + i) * len(lanes) + lane] = work[(FIRST + slot * FIELDS + i) * len(lanes) + lane]


@equation
def put(work: Work, lanes: Lanes, lane: int, row: int, value: float) -> None:
    """Set one row's value in a lane."""
    work[row * len(lanes) + lane] = value


# -- who flies ----------------------------------------------------------------------------------------------------
@procedure
def hand_to_autopilot(work: Work, nav: Work, lanes: Lanes, waiting: bool, at_start: bool, reference: Reference) -> None:
    """Before the hand-over the vehicle stands where its path begins, or is flown on the truth, and notes its place.

    waiting: the hand-over is still to come; at_start: its pad is where its path begins. ATTITUDE_ERROR is the rotation
    from the true attitude to the one that is flown on.
    """
    for lane in range(len(lanes)):
        state = load_helicopter(work, lanes, lane)
        running = load_start(nav, lanes, lane).started > 0.0
        handed = running and not waiting
        true = (state.pos_n, state.pos_e, state.pos_d, state.u, state.v, state.w)
        begins = (reference.pos_n, reference.pos_e, reference.pos_d)
        for i in range(6):
            said = work[(layout.ESTIMATED + i) * len(lanes) + lane]
            if i < 3 and at_start and running and not handed:
                where = begins[i] if work[layout.CONTACT * len(lanes) + lane] > 0.0 else true[i]
                place = work[(layout.PLACE + i) * len(lanes) + lane] + said - where
                put(work, lanes, lane, layout.PLACE + i, place)
            put(work, lanes, lane, layout.ESTIMATED + i, said if handed else true[i])
        row = layout.ESTIMATED_ATTITUDE
        q = (
            work[row * len(lanes) + lane], work[(row + 1) * len(lanes) + lane], work[(row + 2) * len(lanes) + lane],
            work[(row + 3) * len(lanes) + lane],
        )  # fmt: skip
        own = (state.qw, state.qx, state.qy, state.qz)
        turn = quaternion_product(q if handed else own, (state.qw, -state.qx, -state.qy, -state.qz))
        for i in range(4):
            put(work, lanes, lane, layout.ATTITUDE_ERROR + i, turn[i])
            put(work, lanes, lane, row + i, q[i] if handed else own[i])
