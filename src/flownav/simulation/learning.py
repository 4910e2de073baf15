"""The autopilot's learning of its vehicle (`control.learning`) in the loop: stirred, measured and solved.

It is given the IMU's readings and the cyclic commands, and nothing of the truth.
"""

from typing import NamedTuple

from flownav.control.autopilot import AutopilotState, with_learning
from flownav.control.gains import AutopilotGains
from flownav.control.guidance import Knowledge
from flownav.control.learning import (
    AGAIN_EPOCHS,
    LONGEST_EPOCHS,
    LOWEST_M,
    MOST_PERIODS,
    PERIODS,
    SETTLE_EPOCHS,
    SPECTRA,
    STEEPEST,
    STIR,
    STIR_EPOCHS,
    TRIES,
    Learnt,
    Stir,
    note_line,
    solved,
    with_course,
)
from flownav.control.learnt_gains import judged, shaped
from flownav.control.learnt_model import NominalModel
from flownav.core.compile import Lanes, Work, equation, magnitude, procedure
from flownav.core.frames import rotation_from_quaternion
from flownav.simulation import calls, layout
from flownav.simulation.layout import PLANT
from flownav.simulation.plan import ATTITUDE_STEPS
from flownav.simulation.records import Estimated, Home


@equation
def learn(work: Work, lanes: Lanes, epoch: int, gains: AutopilotGains, nominal: NominalModel | None) -> None:
    """Add an epoch to the learning, where a vehicle may be learnt."""
    if nominal is not None:  # noqa: SIM102  (None is a type here: its code is not compiled)
        if nominal.begins >= 0 and epoch >= nominal.begins:
            mind(work, lanes, gains, epoch - nominal.begins)
            for lane in range(len(lanes)):
                stir_lane(work, lanes, lane, nominal)


class Minded(NamedTuple):
    """Result of learning so far, and whether the autopilot waits for more."""

    learnt: Learnt
    autopilot: AutopilotState


@PLANT.on_lanes(calls.mind)
def mind(
    before: Learnt, autopilot: AutopilotState, now: Estimated, home: Home, known: Knowledge, *, gains: AutopilotGains,
    passed: int,
) -> Minded:  # fmt: skip
    """Whether it goes on: in flight, not low, not going around, near the commanded tilt; else it waits.

    passed: epochs since it was to begin.
    """
    rotation = rotation_from_quaternion(now.qw, now.qx, now.qy, now.qz)
    off_pitch, off_roll = autopilot.pitch_sine + rotation[6], autopilot.roll_sine - rotation[7]
    near = magnitude(off_pitch) < STEEPEST and magnitude(off_roll) < STEEPEST
    low = known.ground_found > 0.0 and gains.pad_pos_d_m - now.pos_d_m + home.down_m < LOWEST_M
    well = autopilot.flying > 0.0 and autopilot.away == 0.0 and near and not low
    breaks = before.state == 0.0 and before.since > 0.0 and not well
    waits = breaks or not well
    tries = before.tries + (1.0 if breaks else 0.0)
    since = -float(AGAIN_EPOCHS) if waits else before.since + 1.0
    given_up = (breaks and tries >= TRIES) or passed > LONGEST_EPOCHS
    state = -2.0 if before.state == 0.0 and given_up else before.state
    learnt = with_course(before, state=state, since=since, tries=tries)
    return Minded(learnt, with_learning(autopilot, learns=1.0 if state == 0.0 and autopilot.flying > 0.0 else 0.0))


@procedure
def stir_lane(work: Work, lanes: Lanes, lane: int, nominal: NominalModel) -> None:
    """One lane's epoch of the stir. Note the last one's measurement, and command the next."""
    learnt = layout.load_learnt(work, lanes, lane)
    since = int(learnt.since) - 1
    stir = Stir(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if learnt.state == 0.0 and since >= 0:
        if since == SETTLE_EPOCHS:
            for row in range(SPECTRA):
                work[(layout.SPECTRA + row) * len(lanes) + lane] = 0.0
        if since > SETTLE_EPOCHS:
            felt, asked = layout.load_felt(work, lanes, lane), layout.load_stir(work, lanes, lane)
            rates = (felt.mean_roll_rad_s, felt.mean_pitch_rad_s)
            note_line(work, lanes, layout.SPECTRA, since - SETTLE_EPOCHS - 1, rates, lane, asked)
        stirred = since - SETTLE_EPOCHS
        if stirred > 0 and stirred % (PERIODS * STIR_EPOCHS) == 0:
            conclude(work, lanes, lane, nominal, stirred // STIR_EPOCHS)
        if layout.load_learnt(work, lanes, lane).state == 0.0:
            stir = stir_at((stirred + STIR_EPOCHS) % STIR_EPOCHS)
    layout.store_stir(work, lanes, lane, stir)


@equation
def stir_at(turn: int) -> Stir:
    """The stir added in an epoch of the period: a step of the attitude loop has the middle of its straight piece."""
    after = (turn + 1) % STIR_EPOCHS
    lon_step = (STIR[after, 0] - STIR[turn, 0]) / ATTITUDE_STEPS
    lat_step = (STIR[after, 1] - STIR[turn, 1]) / ATTITUDE_STEPS
    return Stir(STIR[turn, 0] + 0.5 * lon_step, STIR[turn, 1] + 0.5 * lat_step, lon_step, lat_step, 0.0, 0.0)


@procedure
def conclude(work: Work, lanes: Lanes, lane: int, nominal: NominalModel, periods: int) -> None:
    """Judge the learning after a number of periods and shape the gains by it; it goes on where it is too unsure."""
    before = layout.load_learnt(work, lanes, lane)
    learnt = judged(solved(work, lanes, layout.SPECTRA, layout.LEARNING_SCRATCH, lane, nominal, periods))
    layout.store_loop_gains(work, lanes, lane, shaped(layout.load_loop_gains(work, lanes, lane), learnt))
    more = learnt.state == -1.0 and periods < MOST_PERIODS
    state = 0.0 if more else learnt.state
    layout.store_learnt(work, lanes, lane, with_course(learnt, state=state, since=before.since, tries=before.tries))
