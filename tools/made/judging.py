"""The result of one made flight: flownav by its defaults and the line of dead reckoning, against the truth."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.logs.csv_folder import read_csv_folder
from flownav.navigation.flags import flagged, flags_of
from flownav.replays.fed import as_fed
from flownav.replays.judged import TESTED
from flownav.replays.prepare import ReplayOptions
from flownav.replays.session import Replay, replay
from flownav.scoring.path import motion_of
from flownav.scoring.reference import Motion, Window, drift_of, unwarned_share
from made.flight import Made, Truth, heading_of, into_body, write
from made.reckoning import reckoned
from made.signs import Errors, signs_of

TRUTH_EVERY = 10  # of its rows a judge takes one: 100 Hz
FLOW = (Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY)
NEVER = float("inf")  # the drift of a navigator that says nothing


class Line(NamedTuple):
    """A path from take-off to landing: its error at the end, the largest [m], that of its heading at the end [deg]."""

    end_m: float
    worst_m: float
    heading_deg: float


class Verdict(NamedTuple):
    """One flight. path_m: how far it flew, level. ours, line: flownav and dead reckoning.

    level_m: protection level, horizontal, median in flight. unwarned, warned: shares of the flight in which the error
    is beyond it without a warning, and in which a warning stands. nis_flow, nis_range: mean squares of innovations over
    what is stated, in flight. squares (3,): mean squares of the error over the stated one: position (north, east),
    velocity (forward, right), heading. signs: what went wrong first, and when after take-off [s]. why: of a flight that
    was refused.
    """

    name: str
    number: int
    path_m: float
    ours: Line
    line: Line
    level_m: float
    unwarned: float
    warned: float
    nis_flow: float
    nis_range: float
    squares: tuple[float, float, float]
    signs: tuple[str, ...]
    why: str = ""


def judge(made: Made) -> Verdict:
    """Write the flight, read it as any log, replay it by the defaults, and hold both lines against the truth."""
    truth = truth_of(made.truth)
    line = line_of(reckoned(made.tables), truth, window_of(made.truth))
    path_m = path_length(made.truth)
    try:
        with tempfile.TemporaryDirectory() as folder:
            write(made, Path(folder))
            log = read_csv_folder(Path(folder))
        options, settings = as_fed(log, ReplayOptions(), None)
        flown = replay(log, options, settings)
    except InputError as error:
        return _lost(made, line, path_m, str(error).partition(": ")[2])
    return _verdict(made, flown, truth, line, path_m)


def _lost(made: Made, line: Line, path_m: float, why: str) -> Verdict:
    """A flight of which the navigator says nothing."""
    nothing = (np.nan, np.nan, np.nan)
    lost = Line(NEVER, NEVER, NEVER)
    return Verdict(made.name, made.number, path_m, lost, line, np.nan, 1.0, 0.0, np.nan, np.nan, nothing, (), why)


def _verdict(made: Made, flown: Replay, truth: Motion, line: Line, path_m: float) -> Verdict:
    estimate = motion_of(flown.table)
    window = window_of(made.truth)
    drift = drift_of(estimate, truth, window)
    said = flown.estimate_rows
    inside = (said.t_s >= window[0]) & (said.t_s <= window[1])
    if drift is None or not inside.any():
        return _lost(made, line, path_m, "no estimate in flight")
    warned = flagged(said.t_s, flags_of(flown.written.event))
    level = said.protection_m[:, 0]
    errors = errors_of(flown, made.truth)
    return Verdict(
        made.name, made.number, path_m, line_of(estimate, truth, window), line,
        float(np.median(level[inside])), unwarned_share(said.t_s, level, warned, drift), float(warned[inside].mean()),
        nis(flown, FLOW, window), nis(flown, (Sensor.RANGE,), window), errors.squares, signs_of(errors, flown, drift),
    )  # fmt: skip


# -- errors ------------------------------------------------------------------------------------------------------
def truth_of(truth: Truth) -> Motion:
    """The truth as scoring has it."""
    rows = slice(None, None, TRUTH_EVERY)
    heading = np.unwrap(heading_of(truth.quaternion[rows]))
    return Motion(truth.t_s[rows], truth.pos_ned_m[rows], truth.t_s[rows], heading)


def window_of(truth: Truth) -> Window:
    """Take-off and landing [s]."""
    return truth.take_off_s, truth.landing_s


def path_length(truth: Truth) -> float:
    """The level way flown [m], without the smallest of its wobble."""
    return float(np.hypot(*np.diff(truth.pos_ned_m[::200, :2], axis=0).T).sum())


def line_of(estimate: Motion, truth: Motion, flight_s: Window) -> Line:
    """The errors of a path that was right at take-off. flight_s: take-off and landing."""
    drift = drift_of(estimate, truth, flight_s)
    if drift is None:
        return Line(NEVER, NEVER, NEVER)
    at = np.array(flight_s)
    ours = np.interp(at, estimate.heading_t_s, np.unwrap(estimate.heading_rad))
    theirs = np.interp(at, truth.heading_t_s, np.unwrap(truth.heading_rad))
    turn = float(np.diff(ours - theirs)[0])
    ends = drift.t_s[-1] >= flight_s[1] - 1.0  # an estimate that ends in flight is none
    return Line(
        float(drift.horizontal_m[-1]) if ends else NEVER, float(drift.horizontal_m.max()), float(abs(np.rad2deg(turn)))
    )


def nis(flown: Replay, sensors: tuple[Sensor, ...], window: tuple[float, float]) -> float:
    """Mean square of the innovations over what is stated, of components that were tested in a window; NaN without."""
    rows = flown.offered
    told = np.isin(rows.sensor, sensors) & np.isin(rows.reason, TESTED)
    told &= (rows.t_s >= window[0]) & (rows.t_s <= window[1])
    return float(np.mean(rows.innovation[told] ** 2 / rows.innovation_variance[told])) if told.any() else np.nan


def errors_of(flown: Replay, truth: Truth) -> Errors:
    """The errors of the estimate in flight; position and heading from take-off on."""
    said = flown.estimate_rows
    rows = (said.t_s >= truth.take_off_s) & (said.t_s <= truth.landing_s)
    at = np.clip(np.searchsorted(truth.t_s, said.t_s[rows]), 0, len(truth.t_s) - 1)
    quaternion, ours = truth.quaternion[at], said.quaternion[rows]
    velocity = said.vel_frd_m_s[rows] - into_body(quaternion, truth.vel_ned_m_s[at])
    turn = np.unwrap(heading_of(ours)) - np.unwrap(heading_of(quaternion))
    heading = turn - turn[0]
    moved, went = said.pos_ned_m[rows] - said.pos_ned_m[rows][0], truth.pos_ned_m[at] - truth.pos_ned_m[at][0]
    cos, sin = np.cos(turn[0]), np.sin(turn[0])
    place = moved[:, :2] - np.column_stack([cos * went[:, 0] - sin * went[:, 1], sin * went[:, 0] + cos * went[:, 1]])
    below = [into_body(q, np.broadcast_to([0.0, 0.0, 1.0], (len(q), 3))) for q in (quaternion, ours)]
    tilt = np.arccos(np.clip((below[0] * below[1]).sum(axis=1), -1.0, 1.0))
    squares = (
        float(np.mean((place / said.std_pos_ned_m[rows, :2]) ** 2)),
        float(np.mean((velocity[:, :2] / said.std_vel_frd_m_s[rows, :2]) ** 2)),
        float(np.mean((heading / said.std_tilt_ned_rad[rows, 2]) ** 2)),
    )
    height = moved[:, 2] - went[:, 2]
    return Errors(said.t_s[rows], velocity[:, :2], tilt, heading, height, squares)
