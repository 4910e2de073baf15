"""The navigator's turn in each epoch: what is due goes in, its estimate is carried on to now and passed to the
autopilot.

The simulator writes readings into the rows that the navigator takes them from, and reads its estimate; it never touches
the filter.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.control.guidance import Knowledge, Reference
from flownav.core.compile import Lanes, Work, equation, invoke, larger, procedure
from flownav.core.frames import conjugate, quaternion_product, rotation_from_quaternion, to_body, to_earth
from flownav.estimation.consistency import normalised_error
from flownav.estimation.named import Attitude, PositionNed, VelocityNed
from flownav.navigation.memory import load_reading, load_start, store_reading
from flownav.navigation.now import NowState, coasted, moved_on, state_of
from flownav.navigation.records import GroundMemory, Reading, StartMemory, SuspicionMemory
from flownav.simulation import calls, records
from flownav.simulation.block import Aboard
from flownav.simulation.layout import FIELDS, PLANT, ROWS, load_inertial_then, load_slot, store_estimated, store_row
from flownav.simulation.navigator_view import GroundEstimate, PadEstimate, PadVariance, StatedVariance, on_both
from flownav.vehicle.state import Around, HelicopterState

EPOCH_S = 0.02
TRUTH = len(records.TruthThen._fields)
INERTIAL = len(records.InertialThen._fields)

load_truth_then, _ = PLANT.access(records.TruthThen)
load_place, _ = PLANT.access(records.PadPlace)
_, store_nees = PLANT.access(records.Nees)


class Timetable(NamedTuple):
    """The readings in the order in which the navigator takes them (`fitting.schedule_of`).

    t_s (n,), sensor (n,), slot (n,) of the ring, epoch (n,) in which it is taken; slots: of the ring; horizon_epochs:
    how far the navigator lags behind the present; readings: n.
    """

    t_s: NDArray[np.float64]
    sensor: NDArray[np.int64]
    slot: NDArray[np.int64]
    epoch: NDArray[np.int64]
    slots: int
    horizon_epochs: int
    readings: int

    @property
    def horizon_s(self) -> float:
        """How far the navigator lags behind the present [s]."""
        return self.horizon_epochs * EPOCH_S


@equation
def first_truth(table: Timetable) -> int:
    """The first row of the remembered truths, behind the ring."""
    return ROWS + table.slots * FIELDS


@equation
def truth_row(epoch: int, table: Timetable) -> int:
    """The first row of the truth at an epoch, which is remembered for as long as the horizon is."""
    return first_truth(table) + (epoch % (table.horizon_epochs + 1)) * TRUTH


@equation
def first_inertial(table: Timetable) -> int:
    """The first row of the remembered inertial readings, behind the truths."""
    return first_truth(table) + (table.horizon_epochs + 1) * TRUTH


@equation
def kept_inertials(table: Timetable, period_s: float) -> int:
    """How many inertial readings are remembered."""
    return int(np.rint(table.horizon_epochs * EPOCH_S / period_s)) + 1


@equation
def inertial_row(number: int, period_s: float, table: Timetable) -> int:
    """The first row of the remembered inertial reading of that number."""
    return first_inertial(table) + INERTIAL * (number % kept_inertials(table, period_s))


@equation
def feed_due(work: Work, lanes: Lanes, epoch: int, following: int, aboard: Aboard, table: Timetable) -> int:
    """Every reading that is due in this epoch, in order; the next one's number."""
    nav, o = aboard.nav, aboard.o
    while following < table.readings and table.epoch[following] <= epoch:
        for lane in range(len(lanes)):
            store_reading(nav, lanes, lane, load_slot(work, lanes, table.slot[following], lane))
        if o.room[5] > following:
            for lane in range(len(lanes)):
                store_row(aboard.fed, lanes, following * FIELDS, lane, load_reading(nav, lanes, lane))
        invoke(
            aboard.take, nav, aboard.settings, o.estimate, o.innovation, o.event, o.entry, o.state, o.covariance,
            o.room, o.used, table.t_s[following], table.sensor[following],
        )  # fmt: skip
        following += 1
    return following


# -- the truth at the horizon -----------------------------------------------------------------------------------
@PLANT.on_lanes(calls.note_truth)
def note_truth(state: HelicopterState) -> records.TruthThen:
    """The truth of this instant."""
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    vel_n, vel_e, vel_d = to_earth(rotation, state.u, state.v, state.w)
    return records.TruthThen(
        state.pos_n, state.pos_e, state.pos_d, vel_n, vel_e, vel_d, state.qw, state.qx, state.qy, state.qz
    )


NOTHING_STATED = records.Spread(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # before the start: lanes start one by one


class Compared(NamedTuple):
    """The navigator beside the truth."""

    error: records.HorizonError
    stated: records.Spread


@on_both(calls.compare_at_horizon)
def compare_at_horizon(
    start: StartMemory, position: PositionNed, velocity: VelocityNed, attitude: Attitude, stated: StatedVariance,
    then: records.TruthThen, *, reached: bool,
) -> Compared:  # fmt: skip
    """Errors of the navigator where it stands, and their variances. reached: the horizon is past the start."""
    running = start.started > 0.0 and reached
    own = rotation_from_quaternion(attitude.qw, attitude.qx, attitude.qy, attitude.qz)
    true = rotation_from_quaternion(then.qw, then.qx, then.qy, then.qz)
    moved_ned = to_body(own, velocity.vel_n, velocity.vel_e, velocity.vel_d)
    was = to_body(true, then.vel_n_m_s, then.vel_e_m_s, then.vel_d_m_s)
    return Compared(
        records.HorizonError(
            position.pos_n - then.pos_n_m if running else np.nan,
            position.pos_e - then.pos_e_m if running else np.nan,
            position.pos_d - then.pos_d_m if running else np.nan,
            moved_ned[0] - was[0] if running else np.nan,
            moved_ned[1] - was[1] if running else np.nan,
            moved_ned[2] - was[2] if running else np.nan,
        ),
        records.Spread(*stated) if start.started > 0.0 else NOTHING_STATED,
    )


@procedure
def note_normalised_error(work: Work, nav: Work, lanes: Lanes, reached: bool, row: int) -> None:
    """e' P^-1 e of the navigator's position and velocity where it stands."""
    for lane in range(len(lanes)):
        then = load_truth_then(work, lanes, row, lane)
        nees = normalised_error(nav, lanes, lane, then[:6])
        running = load_start(nav, lanes, lane).started > 0.0 and reached
        store_nees(work, lanes, lane, records.Nees(nees if running else np.nan))


class OnTruth(NamedTuple):
    """Where the navigator is put."""

    position: PositionNed
    velocity: VelocityNed
    attitude: Attitude


@on_both(calls.put_on_truth)
def put_on_truth(
    start: StartMemory, position: PositionNed, velocity: VelocityNed, attitude: Attitude, then: records.TruthThen,
    *, reached: bool,
) -> OnTruth:  # fmt: skip
    """The navigator's position, velocity and attitude become the truth at its horizon, for Jacobians to be taken there.

    Its covariance is then that of the posterior Cramér-Rao bound along this flight, for its model.
    """
    running = start.started > 0.0 and reached
    return OnTruth(
        PositionNed(then.pos_n_m, then.pos_e_m, then.pos_d_m) if running else position,
        VelocityNed(then.vel_n_m_s, then.vel_e_m_s, then.vel_d_m_s) if running else velocity,
        Attitude(then.qw, then.qx, then.qy, then.qz) if running else attitude,
    )


# -- from the horizon to now --------------------------------------------------------------------------------------
@on_both(calls.find_place)
def find_place(
    place: records.PadPlace, pad: PadEstimate, ground: GroundMemory, below: GroundEstimate
) -> records.PadPlace:
    """The pad's place by its camera and by the range, where they have found it."""
    found, grounded = pad.known > 0.0, ground.known > 0.0
    return records.PadPlace(
        pad.north_m if found else place.north_m,
        pad.east_m if found else place.east_m,
        below.down_m if grounded else place.down_m,
    )


@procedure
def carry_ahead(
    work: Work, nav: Work, lanes: Lanes, inertial: int, ahead: int, period_s: float, table: Timetable
) -> None:
    """Store the estimate of now: the navigator's state moved on by the newest `ahead` of the `heard` inertial readings.

    Position is counted from where the vehicle takes its pad to be: a camera's pad, else what it noted; its height over
    the ground that a range has found.
    """
    find_place(work, lanes, nav)
    for lane in range(len(lanes)):
        c = state_of(nav, lanes, lane)
        for k in range(inertial - ahead, inertial):
            between = load_inertial_then(work, lanes, inertial_row(k, period_s, table), lane)
            has_motion = np.isfinite(between.rate_x_rad_s + between.force_x_m_s2)
            c = moved_on(c, between, period_s) if has_motion else coasted(c, period_s)
        store_estimated(work, lanes, lane, over_pad(c, load_place(work, lanes, lane)))


@equation
def over_pad(c: NowState, place: records.PadPlace) -> records.Estimated:
    """The state as the autopilot uses it: position over the pad, body velocity and attitude."""
    u, v, w = to_body(rotation_from_quaternion(c.qw, c.qx, c.qy, c.qz), c.vel_n, c.vel_e, c.vel_d)
    return records.Estimated(
        c.pos_n - place.north_m, c.pos_e - place.east_m, c.pos_d - place.down_m, u, v, w, c.qw, c.qx, c.qy, c.qz
    )


@on_both(calls.note_knowledge)
def note_knowledge(
    before: Knowledge, around: Around, pad: PadEstimate, variance: PadVariance, ground: GroundMemory,
    suspicion: SuspicionMemory,
) -> Knowledge:  # fmt: skip
    """Knowledge of the landing, by the vehicle's navigator and its camera, an epoch later."""
    found = pad.known > 0.0
    north = variance.over_n_m2 if found else variance.own_n_m2
    east = variance.over_e_m2 if found else variance.own_e_m2
    sigma_m = np.sqrt(larger(larger(north, east), 0.0)) if np.isfinite(north + east) else np.inf
    unseen_s = before.pad_unseen_s + EPOCH_S
    powerless_s = before.powerless_s + EPOCH_S if around.engine == 0.0 else 0.0  # as the speed controller reports
    return Knowledge(
        1.0 if found else 0.0, ground.known, unseen_s, sigma_m, 1.0 if suspicion.suspected > 0.0 else 0.0, powerless_s
    )


@PLANT.on_lanes(calls.keep_inertial)
def keep_inertial(reading: Reading) -> records.InertialThen:
    """Remember the reading that was just put into a slot."""
    return records.InertialThen(
        reading.value_0, reading.value_1, reading.value_2, reading.value_3, reading.value_4, reading.value_5
    )


# -- who flies ----------------------------------------------------------------------------------------------------
class AtHandover(NamedTuple):
    """The autopilot's feedback, with the place from which it counts and the error of the attitude."""

    place: records.PadPlace
    estimated: records.Estimated
    error: records.AttitudeError


@on_both(calls.hand_to_autopilot)
def hand_to_autopilot(
    state: HelicopterState, start: StartMemory, loads: records.Loads, place: records.PadPlace, now: records.Estimated,
    *, waiting: bool, at_start: bool, reference: Reference,
) -> AtHandover:  # fmt: skip
    """Before the hand-over the vehicle stands where its path begins, or flies with the truth as feedback, and notes its
    place.

    waiting: the hand-over is still to come; at_start: its pad is where its path begins.
    """
    running = start.started > 0.0
    in_charge = running and not waiting
    notes, stands = at_start and running and not in_charge, loads.contact_n > 0.0
    noted = records.PadPlace(
        place.north_m + now.pos_n_m - (reference.pos_n if stands else state.pos_n),
        place.east_m + now.pos_e_m - (reference.pos_e if stands else state.pos_e),
        place.down_m + now.pos_d_m - (reference.pos_d if stands else state.pos_d),
    )
    truth = records.Estimated(
        state.pos_n, state.pos_e, state.pos_d, state.u, state.v, state.w, state.qw, state.qx, state.qy, state.qz
    )
    flown = now if in_charge else truth
    turn = quaternion_product(
        (flown.qw, flown.qx, flown.qy, flown.qz), conjugate((state.qw, state.qx, state.qy, state.qz))
    )
    return AtHandover(noted if notes else place, flown, records.AttitudeError(*turn))
