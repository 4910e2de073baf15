"""A reference that is not the path: it leaps, stands still, drifts or is turned from some second on, held against flow.

A leap is taken out of its positions, what stands is left out, and where it drifts or turns the flight is cut in two:
the piece that agrees better with the flow, or the longer one, is identified. Each is named with its second.
"""

from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array, Stream
from flownav.lab.identification.flight import LEAST_FLOW, Flight
from flownav.lab.identification.offset import Offset
from flownav.lab.identification.reference_motion import Motion, on_grid
from flownav.logs.log import mean_over
from flownav.logs.references import lasting, leaps_of, listed

STANDS_S, MOVING_M_S, BESIDE_S = 1.5, 0.3, 1.0
BLOCK_S, LEAST_PIECE_S, LEAST_BLOCKS = 1.0, 12.0, 24
DRIFT_M_S, TURN_RAD = 0.25, 0.2  # from which on a piece differs from the other
BETTER = 0.6  # of the residual's power, that two pieces leave of one's
CLEARLY_LESS = 0.8  # of the residual's power, that a drifting reference leaves of an offset's
REST_S, REST_BESIDE_S = 3.0, 1.0  # on the ground without a break, with which a drift is measured, and at either end
LEAST_DRIFT_M_S, ALIKE = 0.03, 0.3  # chosen: slower, or apart by more than such a share, is no steady drift


class Mended(NamedTuple):
    """The flight with what can be used of its reference, and what is wrong with the rest, one line each."""

    flown: Flight
    notes: tuple[str, ...]


def without_leaps_and_stands(flown: Flight) -> Mended:
    """The reference's positions without leaps, and the flight without the seconds in which it stands still."""
    t_s, place = flown.reference_t_s, flown.reference_m
    if flown.reference == "imu" or len(t_s) < LEAST_BLOCKS:
        return Mended(flown, ())
    good, notes, ends = flown.good.copy(), [], []
    for begin, end in _stands(t_s, place):
        inside = (flown.t_s > begin) & (flown.t_s < end) & flown.good
        if inside.sum() > 1 and float(np.median(np.hypot(*flown.velocity_m_s[inside].T))) > MOVING_M_S:
            good &= ~((flown.t_s > begin - BESIDE_S) & (flown.t_s < end + BESIDE_S))
            notes.append(f"{flown.reference_name} stands still from {begin:.1f} to {end:.1f} s while the flow moves")
            ends.append(end)
    for leap in lasting(leaps_of(t_s, place), t_s, place):
        place = np.where((t_s >= leap.t_s)[:, None], place - leap.by_ned_m, place)
        if not any(abs(leap.t_s - end) < BESIDE_S for end in ends):
            notes.append(f"{flown.reference_name} leaps {listed([leap])}")
            good &= np.abs(flown.t_s - leap.t_s) > 0.5 * BESIDE_S
    if not notes or np.count_nonzero(good) < LEAST_FLOW:
        return Mended(flown, ())
    return Mended(replace(flown, good=good, reference_m=place), tuple(notes))


def _stands(t_s: Array, place: Array) -> list[tuple[float, float]]:
    """From when to when the reference repeats one place."""
    same = np.concatenate([[False], (np.diff(place, axis=0) == 0.0).all(axis=1), [False]])
    edges = np.flatnonzero(np.diff(same.astype(int))).reshape(-1, 2)
    spans = [(float(t_s[a]), float(t_s[min(b, len(t_s) - 1)])) for a, b in edges]
    return [(a, b) for a, b in spans if b - a >= STANDS_S]


# -- in two pieces -------------------------------------------------------------------------------------------------
def in_one_piece(flown: Flight, moved: Motion) -> Mended:
    """The piece of the flight before or after the reference begins to drift or is turned; all of it where it is not."""
    if flown.reference != "truth":  # a receiver's velocity is its own, and errs by as much for seconds
        return Mended(flown, ())
    t_s, flow, reference, *_ = _blocks(flown, moved)
    if len(t_s) < LEAST_BLOCKS:
        return Mended(flown, ())
    whole = _fitted(flow, reference)
    cuts = [k for k in range(len(t_s)) if min(t_s[k] - t_s[0], t_s[-1] - t_s[k]) >= LEAST_PIECE_S]
    pieces = [(k, _fitted(flow[:k], reference[:k]), _fitted(flow[k:], reference[k:])) for k in cuts]
    if not pieces:
        return Mended(flown, ())
    cut, before, after = min(pieces, key=lambda one: one[1][2] + one[2][2])
    if before[2] + after[2] > BETTER * whole[2] or min(abs(before[0]), abs(after[0])) < 1e-3:
        return Mended(flown, ())
    turn = float(np.angle(after[0] / before[0]))
    drift = abs(after[1] / after[0] - before[1] / before[0])
    if abs(turn) < TURN_RAD and drift < DRIFT_M_S:
        return Mended(flown, ())
    at_s = float(t_s[cut] - 0.5 * BLOCK_S)
    turned = abs(turn) >= TURN_RAD
    what = f"is turned by {abs(np.degrees(turn)):.0f} degrees" if turned else f"drifts by {drift:.2f} m/s"
    early = (cut >= len(t_s) - cut) if turned else abs(before[1]) <= abs(after[1])
    kept = flown.good & ((flown.t_s < at_s - BESIDE_S) if early else (flown.t_s > at_s + BESIDE_S))
    used = "before" if early else "after"
    return Mended(
        replace(flown, good=kept),
        (f"{flown.reference_name} {what} from {at_s:.1f} s on; the flight {used} is identified",),
    )


def drift_throughout(flown: Flight, moved: Motion) -> float | None:
    """The speed by which the reference drifts all the time [m/s]; None where the flow has an offset instead.

    A drift is fixed in earth axes, an offset in the body's and grows with the range: turns and climbs tell them apart.
    Where neither leaves clearly less of the difference it is taken for the flow's.
    """
    if flown.reference != "truth":
        return None
    t_s, flow, reference, ahead, lever = _blocks(flown, moved)
    if len(t_s) < LEAST_BLOCKS:
        return None
    (_, _, drift), left = _solved(flow, ahead, reference - ahead, np.ones(len(t_s)))
    _, by_offset = _solved(flow, ahead, reference - ahead, lever)
    gain = abs(_fitted(flow, reference)[0])
    return float(abs(drift) / gain) if left < CLEARLY_LESS * by_offset and gain > 1e-3 else None


def drift_at_rest(flown: Flight, landed: Stream | None) -> float | None:
    """The speed at which the reference moves while the vehicle stands [m/s], the same in every half of every rest.

    None where it stands as well, moves unsteadily (a landed state that is wrong), or there is no landed state. In the
    flight of a vehicle that keeps nose and height an offset of the flow and a drift of the reference look alike.
    """
    if flown.reference != "truth" or landed is None:
        return None
    ends_s = np.append(landed.t_s[1:], flown.reference_t_s[-1])
    halves = []
    for begin, end, stands in zip(landed.t_s, ends_s, landed.value[:, 0], strict=True):
        first, last = begin + REST_BESIDE_S, end - REST_BESIDE_S
        if stands and last - first >= REST_S:
            middle = 0.5 * (first + last)
            halves += [_mean_velocity(flown, first, middle), _mean_velocity(flown, middle, last)]
    if not halves:
        return None
    speed = float(np.linalg.norm(np.mean(halves, axis=0)))
    apart = max(float(np.linalg.norm(one - other)) for one, other in combinations(halves, 2))
    return speed if speed >= LEAST_DRIFT_M_S and apart <= ALIKE * speed else None


def _mean_velocity(flown: Flight, begin_s: float, end_s: float) -> Array:
    """Of the reference, level, shape (2,) [m/s]."""
    ends = on_grid(flown.reference_t_s, flown.reference_m[:, :2], np.array([begin_s, end_s]))
    return np.asarray((ends[1] - ends[0]) / (end_s - begin_s))


class _Blocks(NamedTuple):
    """Means over BLOCK_S in earth axes, as complex numbers (m,): level velocity by the flow and by the reference, its
    part along the vehicle's nose, and the velocity that an offset of 1 rad/s ahead makes.
    """

    t_s: Array
    flow: Array
    reference: Array
    ahead: Array
    lever: Array


def _blocks(flown: Flight, moved: Motion) -> _Blocks:
    """The flight's blocks, those that have readings."""
    t_s = flown.t_s[flown.good]
    seen = t_s - flown.age_s
    level = flown.rotation(seen)[:, :2, :2]
    earth = np.einsum("nij,nj->ni", level, flown.velocity_m_s[flown.good])
    reference = on_grid(moved.t_s, moved.velocity_m_s[:, :2], seen)
    nose = level[:, :, 0] / np.linalg.norm(level[:, :, 0], axis=1)[:, None]
    ahead = nose * np.sum(nose * reference, axis=1)[:, None]
    lever = level[:, :, 0] * flown.range_m[flown.good, None]
    middles = np.arange(t_s[0] + BLOCK_S, t_s[-1] - BLOCK_S, BLOCK_S)
    after = np.clip(np.searchsorted(t_s, middles), 1, len(t_s) - 1)
    middles = middles[np.minimum(np.abs(middles - t_s[after - 1]), np.abs(t_s[after] - middles)) < 0.5 * BLOCK_S]
    columns = np.column_stack([earth, reference, ahead, lever])
    means = mean_over(t_s, columns, middles - 0.5 * BLOCK_S, middles + 0.5 * BLOCK_S)
    return _Blocks(middles, *(means[:, k] + 1j * means[:, k + 1] for k in range(0, 8, 2)))


def _fitted(flow: Array, reference: Array) -> tuple[complex, complex, float]:
    """flow = gain reference + constant, all complex; and the residual's power."""
    (gain, constant), left = _solved(flow, reference, np.ones(len(reference)))
    return complex(gain), complex(constant), left


def _solved(flow: Array, *columns: Array) -> tuple[Array, float]:
    """The complex factors of columns (m,) that make the flow, by least squares; and the residual's power."""
    design = np.column_stack(columns)
    factors = np.asarray(np.linalg.lstsq(design, flow, rcond=None)[0])
    return factors, float(np.sum(np.abs(flow - design @ factors) ** 2))


def drift_like(offset: Offset | None, flown: Flight, moved: Motion, landed: Stream | None) -> float | None:
    """The speed of a reference that drifts, where that is what looks like an offset of the flow [m/s]; else None.

    A landed state alone does not show it, for it may be wrong: the drift must be as large as the offset looks.
    """
    if offset is None or not offset.matters:
        return None
    if (drift_m_s := drift_throughout(flown, moved)) is not None:
        return drift_m_s
    drift_m_s = drift_at_rest(flown, landed)
    looks_m_s = float(np.hypot(offset.x.value, offset.y.value) * np.median(flown.range_m[flown.good]))
    return drift_m_s if drift_m_s is not None and 0.5 * looks_m_s <= drift_m_s <= 2.0 * looks_m_s else None
