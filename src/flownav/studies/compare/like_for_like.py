"""One measure for all estimators of a log: the same reference, at the same instants, the same way laid on it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array, Sensor
from flownav.core.record import POSITION_NED
from flownav.logs.log import Log
from flownav.scoring.alignment import Alignment, align, velocity_of
from flownav.scoring.autopilot import columns_of
from flownav.studies.compare.tracks import Track, at, says

LEAST_INSTANTS = 10

Flags = NDArray[np.bool_]
Window = tuple[float, float]


class Reference(NamedTuple):
    """What estimates are held against: "truth", whose frame may be turned, or "gps", with its delay taken off.

    position (n, 3) and velocity (m, 2) north, east, down, each at its own instants.
    """

    against: str
    position_t_s: Array
    position: Array
    velocity_t_s: Array
    velocity: Array


def reference_of(log: Log, gps_delay_s: float) -> Reference | None:
    """The best that the log has; None without any."""
    if log.truth is not None:
        t_s = np.asarray(log.truth["t_s"], float)
        position = columns_of(log.truth, POSITION_NED)
        known = np.isfinite(position).all(axis=1)
        t_s, position = t_s[known], position[known]
        if len(t_s) >= LEAST_INSTANTS:
            return Reference("truth", t_s, position, t_s, velocity_of(t_s, position)[:, :2])
    if Sensor.GPS_POSITION not in log.streams:
        return None
    fixes, speeds = log.streams[Sensor.GPS_POSITION], log.streams.get(Sensor.GPS_VELOCITY)
    position_t_s, moving = fixes.t_s - gps_delay_s, np.zeros((0, 2))
    velocity_t_s = np.zeros(0)
    if speeds is not None:
        known = np.isfinite(speeds.value[:, :2]).all(axis=1)
        velocity_t_s, moving = speeds.t_s[known] - gps_delay_s, speeds.value[known, :2]
    return Reference("gps", position_t_s, fixes.value, velocity_t_s, moving)


def shared_by(tracks: Sequence[Track], instants_s: Array) -> tuple[Flags, list[bool]]:
    """Instants (n,) at which the estimators have rows, and which estimators that leaves in.

    The first always is; another is left out where fewer than LEAST_INSTANTS would be left with it.
    """
    shared: Flags = np.ones(len(instants_s), bool)
    kept = []
    for number, track in enumerate(tracks):
        with_it = np.asarray(shared & says(track, instants_s))
        stays = number == 0 or bool(np.count_nonzero(with_it) >= LEAST_INSTANTS)
        shared = with_it if stays else shared
        kept.append(stays)
    return shared, kept


def errors_of(
    track: Track, reference: Reference, places: Flags, speeds: Flags, window: Window | None = None
) -> dict[str, Any]:
    """Horizontal errors at the instants marked in places (n,) and speeds (m,), and in the window where one is given.

    The reference is laid on the track over these very instants: truth turned and shifted (least squares), GPS shifted.
    None each where fewer than LEAST_INSTANTS are left, or the track states no velocity.
    """
    if window is not None:
        places = places & _within(reference.position_t_s, window)
        speeds = speeds & _within(reference.velocity_t_s, window)
    t_s, position = reference.position_t_s[places], reference.position[places]
    if len(t_s) < LEAST_INSTANTS:
        return {"horizontal_rms_m": None, "velocity_rms_m_s": None, "samples": len(t_s)}
    ours = at(track, track.motion.position, t_s)
    placed = _laid_on(ours, position, reference.against)
    error = ours - placed.moved(position)
    moved = np.column_stack([reference.velocity[speeds], np.zeros(np.count_nonzero(speeds))])
    slip = at(track, track.velocity_ne, reference.velocity_t_s[speeds]) - placed.turned(moved)[:, :2]
    return {"horizontal_rms_m": _rms(error), "velocity_rms_m_s": _rms(slip), "samples": len(t_s)}


def _laid_on(ours: Array, reference: Array, against: str) -> Alignment:
    if against == "truth":
        return align(ours, reference)
    north, east, down = (ours - reference).mean(axis=0).tolist()
    return Alignment(0.0, (north, east, down))


def _within(t_s: Array, window: Window) -> Flags:
    return np.asarray((t_s >= window[0]) & (t_s <= window[1]))


def _rms(error: Array) -> float | None:
    """Of the horizontal length [the unit of error]; None of too few, or of what is not known."""
    squares = np.sum(error[:, :2] ** 2, axis=1)
    squares = squares[np.isfinite(squares)]
    return float(np.sqrt(np.mean(squares))) if len(squares) >= LEAST_INSTANTS else None
