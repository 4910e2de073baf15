"""Does a log's reference move as the log's own sensors saw the vehicle move? Its hand, heading, standstills and time.

What one sensor alone says may be that sensor's own fault, such as an axis of the flow with the wrong sign: then both
are named and nothing is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from flownav.core.frames import heading_from_quaternion
from flownav.core.measurement import Array
from flownav.core.record import QUATERNION, VELOCITY_BODY, Table
from flownav.logs import standstills
from flownav.logs.log import Log
from flownav.logs.motion_fit import ALIKE_RAD, FITS_NOISILY, LAG_STEP_S, LATEST_S, Fit, fit_of, path_of, turn_rad
from flownav.logs.witnesses import ACCELEROMETER, FLOW, GPS, Witness, witnesses_of

LATE_S = {GPS: 0.5, ACCELEROMETER: 0.3, FLOW: 0.3}  # a receiver's own delay is 0.1 to 0.3 s
LEAST_TURN_RAD = np.radians(25.0)  # of what was seen against the path: chosen, beyond a compass's errors


def moves_as_seen(log: Log) -> Log:
    """The log with those faults of its reference noted that its GPS, accelerometer and flow show.

    A path that is mirrored by two of them, none being against it, is left out; a heading that contradicts the path by
    two of them, too; rows in which the path repeats one place while the vehicle goes on, too. What one alone shows, and
    a lag, is named only.
    """
    if log.truth is None or len(log.truth["t_s"]) < 2:
        return log
    witnesses = witnesses_of(log.truth, log.streams)
    stuck, by = standstills.stuck_of(log.truth, witnesses, log.streams)
    if stuck:
        note = f"{standstills.words_of(stuck)} while {by} shows that the vehicle goes on; these rows are left out"
        truth = standstills.without(log.truth, stuck)
        log = replace(log, truth=truth, notes=(*log.notes, f"{log.truth_name} {note}"))
    t_s, path = path_of(log.truth or {})
    fits = [(witness, fit) for witness in witnesses if (fit := fit_of(t_s, path, witness)) is not None]
    note, useless = _mirrored(fits)
    if note:
        log = replace(log, notes=(*log.notes, f"{log.truth_name}{' is left out' if useless else ''}: {note}"))
    if useless:
        return replace(log, truth=None, heading_truth=None)
    right = [(witness, fit) for witness, fit in fits if fit.explained >= FITS_NOISILY and fit.hand >= 0]
    note, useless = _turned(t_s, path, _heading(log), right)
    if note:
        log = replace(log, notes=(*log.notes, f"{log.truth_name}: {note}"))
    if useless and log.truth is not None:
        log = replace(log, truth=_without_heading(log.truth), heading_truth=None)
    late = _late(right)
    return replace(log, notes=(*log.notes, f"{log.truth_name} {late}")) if late else log


def _mirrored(fits: Sequence[tuple[Witness, Fit]]) -> tuple[str, bool]:
    """In words whether the path's mirror image is what was flown, and whether that is sure: by two sensors that do not
    both hang on the gyro's sign, none being against it.
    """
    against = {witness.name: fit for witness, fit in fits if fit.hand < 0}
    if sum(fit.hand for _, fit in fits) >= 0:
        return "", False
    by_gyro = all(witness.by_gyro for witness, fit in fits if fit.hand < 0)
    first, *others = against
    how = f"(R² {against[first].mirrored:.2f} by the mirror image, {against[first].explained:.2f} as it is)"
    if others and not by_gyro and not any(fit.hand > 0 for _, fit in fits):
        return (
            f"its path is mirrored, as {first} {how} and {' and '.join(others)} show; give east to the right of north",
            True,
        )
    names = " and ".join(against)
    return f"its path is mirrored against {names} {how}: an axis of one of them has the wrong sign", False


def _late(fits: Sequence[tuple[Witness, Fit]]) -> str:
    """By how much a reference is late or early against the accelerometer, else against the first that shows it."""
    fit_by = {witness.name: fit for witness, fit in fits}
    name = ACCELEROMETER if ACCELEROMETER in fit_by else next(iter(fit_by), "")
    if not name or abs(fit_by[name].lag_s) < LATE_S[name] or not fit_by[name].is_late:
        return ""
    fit = fit_by[name]
    way = "late" if fit.lag_s > 0.0 else "early"
    most = "or more " if abs(fit.lag_s) >= LATEST_S - LAG_STEP_S else ""
    return (
        f"is {abs(fit.lag_s):.2f} s {most}{way} against {name} (R² {fit.explained:.2f} with that, {fit.at_once:.2f} "
        "without): errors against it hold the way that is flown meanwhile"
    )


def _heading(log: Log) -> tuple[Array, Array] | None:
    """The reference's headings, t_s and [rad] (n,); None without."""
    if log.heading_truth is not None:
        t_s, yaw = (np.asarray(log.heading_truth[name], float) for name in ("t_s", "yaw_rad"))
    elif log.truth is not None and set(QUATERNION) <= log.truth.keys():
        t_s = np.asarray(log.truth["t_s"], float)
        yaw = np.asarray(heading_from_quaternion(*(np.asarray(log.truth[name], float) for name in QUATERNION)))
    else:
        return None
    known = np.isfinite(yaw)
    return (t_s[known], np.unwrap(yaw[known])) if np.count_nonzero(known) > 1 else None


def _turned(
    t_s: Array, path: Array, heading: tuple[Array, Array] | None, fits: Sequence[tuple[Witness, Fit]]
) -> tuple[str, bool]:
    """In words whether what was seen forward and right, turned by the reference's own heading, points beside its path
    all the while, and whether that is sure.
    """
    turns = {
        witness.name: by
        for witness, fit in fits
        if heading is not None and (by := turn_rad(t_s, path, heading, witness, fit.lag_s)) is not None
    }
    beside = {name: by for name, by in turns.items() if abs(by) >= LEAST_TURN_RAD}
    if not beside or len(beside) < len(turns):
        return "", False  # nobody shows it, or another sensor agrees with the heading
    first = next(iter(beside.values()))
    agree = all(abs(np.angle(np.exp(1j * (by - first)))) <= ALIKE_RAD for by in beside.values())
    how = f"points {abs(np.degrees(first)):.0f}° to the {'left' if first > 0.0 else 'right'} of the path"
    words = "its path and its heading contradict each other"
    if len(beside) > 1 and agree:
        return f"{words}: what {' and '.join(beside)} saw, turned by the heading, {how}; its heading is left out", True
    (name, *_) = beside
    return f"{words}, or {name} is mounted turned: what it saw, turned by the heading, {how}", False


def _without_heading(truth: Table) -> Table:
    return {name: column for name, column in truth.items() if name not in {*QUATERNION, *VELOCITY_BODY}}
