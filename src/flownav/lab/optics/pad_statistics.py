"""Statistics of a pad detector over frames of many flights: rates, noise and bias by height and speed, and laws of
them.

**Bias** lasts as long as a flight: of the boresight (two angles), of the scale of angles (a focal length that is
believed too long shows them too small), of the distance. **Noise** is what is left within the flights,

    sigma^2 = floor^2 + (per_m r)^2 + (per_rad_s w)^2,

r the reach (the distance squared over the height: from there a level pad looks as small straight above it) and w the
rate at which the ground straight below passes: the detector's own, the resolution of few pixels, and the motion while
the rows are exposed one after the other. **Missed** are a share `hidden` of each flight's frames, whatever it does
(objects on the pad, glare), and of the rest those of a probit in r and w.
"""

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import binom, norm

from flownav.core.errors import InputError, arg
from flownav.core.measurement import Array
from flownav.lab.optics.pad_trial import TrialFrame

LEAST_SHARE = 0.5  # of the frames with the whole pad in view: heights that give fewer fixes are out of range
LEAST_FRAMES = 5
EASY_RATE_RAD_S, EASY_PART = 1.75, 0.75
SHARE_FLOOR = 1e-3  # of missed frames: fewer cannot be measured with some thousand frames
UNLIKELY_PROBABILITY = 0.01
REACH_STEP = 1.2
FIT_PASSES = 3


class Cell(NamedTuple):
    """The frames of one height and speed. in_view: with the whole board in them; found: of those; wrong: of all.

    Sigmas are of the found, each flight's own bias taken out; NaN where there are fewer than LEAST_FRAMES.
    """

    height_m: float
    speed_m_s: float
    image_rate_rad_s: float
    frames: int
    in_view: int
    found: int
    wrong: int
    angle_sigma_rad: float
    distance_sigma: float
    heading_sigma_rad: float
    reasons: dict[str, int]


class NoiseLaw(NamedTuple):
    """sigma^2 = floor^2 + (per_m r)^2 + (per_rad_s w)^2, and how it differs between flights (sigma of a logarithm)."""

    floor: float
    per_m: float
    per_rad_s: float
    spread: float


class MissedLaw(NamedTuple):
    """Shares of missed frames: low and slow, at the greatest height, at the image rate `blur_rad_s`.

    hidden (a, b): of a beta distribution of the share of a flight's frames that is lost whatever it does.
    """

    share: float
    share_at_max_height: float
    share_at_blur: float
    blur_rad_s: float
    hidden: tuple[float, float]


class PadLaws(NamedTuple):
    """A pad camera as a sensor."""

    min_height_m: float
    max_height_m: float
    angle: NoiseLaw  # [rad], of each of the two
    distance: NoiseLaw  # as a part of it
    bias_rad: float  # of each angle at the image's middle, one standard deviation over cameras
    scale: float  # of tangents (less) and distances (more) together
    missed: MissedLaw
    false_share: float  # of all frames
    frames: int
    flights: int


class FlightBias(NamedTuple):
    """Errors that last for one flight: two angles, the scale of angles (as a focal length too long), the distance's."""

    forward_rad: float
    right_rad: float
    scale: float
    distance: float


def columns_of(frames: Sequence[TrialFrame]) -> dict[str, Array]:
    """The frames as columns."""
    names = ("flight", "height_m", "reach_m", "speed_m_s", "image_rate_rad_s", "whole", "found", "wrong")
    found = {name: np.array([getattr(f, name) for f in frames], float) for name in names}
    return found | {"tangents": np.array([f.tangents for f in frames]), "error": np.array([f.error for f in frames])}


# -- bias and noise ----------------------------------------------------------------------------------------------
def biases_and_laws(c: dict[str, Array]) -> tuple[dict[int, FlightBias], NoiseLaw, NoiseLaw, Array]:
    """Each flight's bias, the laws of angle and distance, and the errors (n, 4) without the biases, NaN where unfound.

    Biases are weighted by the law, the law fitted to what they leave, in turn.
    """
    used = (c["found"] > 0.0) & np.isfinite(c["error"]).all(1)
    angle = distance = NoiseLaw(1.0, 0.0, 0.0, 0.0)
    left = np.full_like(c["error"], np.nan)
    biases: dict[int, FlightBias] = {}
    for _ in range(FIT_PASSES):
        for flight in np.unique(c["flight"][used]):
            own = used & (c["flight"] == flight)
            if own.sum() >= LEAST_FRAMES:
                biases[int(flight)], left[own] = _bias(c, own, angle, distance)
        kept = np.isfinite(left).all(1)
        if kept.sum() < LEAST_FRAMES:
            raise InputError(
                "pad: too few frames with a fix for a datasheet; "
                f"give more {arg('frames')}, or other {arg('heights_m')}"
            )
        h, w, flights = c["reach_m"][kept], c["image_rate_rad_s"][kept], c["flight"][kept]
        angle = fitted_noise(left[kept, :2], h, w, flights)
        distance = fitted_noise(left[kept, 2:3], h, w, flights)
    return biases, angle, distance, left


def _bias(c: dict[str, Array], own: NDArray[np.bool_], angle: NoiseLaw, distance: NoiseLaw) -> tuple[FlightBias, Array]:
    error, tangents = c["error"][own], c["tangents"][own]
    weight = 1.0 / sigma_of(angle, c["reach_m"][own], c["image_rate_rad_s"][own])
    lever = -tangents / (1.0 + (tangents**2).sum(1, keepdims=True))  # by which a focal length too long shows less angle
    one, none = np.ones(len(error)), np.zeros(len(error))
    design = np.concatenate([np.column_stack([one, none, lever[:, 0]]), np.column_stack([none, one, lever[:, 1]])])
    seen, both = error[:, :2].T.ravel(), np.tile(weight, 2)
    found = np.linalg.lstsq(design * both[:, None], seen * both, rcond=None)[0]
    far = 1.0 / sigma_of(distance, c["reach_m"][own], c["image_rate_rad_s"][own]) ** 2
    long = float((far * error[:, 2]).sum() / far.sum())
    left = error.copy()
    left[:, :2] -= (design @ found).reshape(2, -1).T
    left[:, 2] -= long
    return FlightBias(float(found[0]), float(found[1]), float(found[2]), long), left


def sigma_of(law: NoiseLaw, reach_m: Array, rate_rad_s: Array) -> Array:
    """The law's standard deviation."""
    return np.asarray(np.sqrt(law.floor**2 + (law.per_m * reach_m) ** 2 + (law.per_rad_s * rate_rad_s) ** 2))


def _law(logs: Array) -> NoiseLaw:
    floor, per_m, per_rad_s = (float(x) for x in np.exp(logs))
    return NoiseLaw(floor, per_m, per_rad_s, 0.0)


def fitted_noise(left: Array, reach_m: Array, rate_rad_s: Array, flights: Array) -> NoiseLaw:
    """The law of greatest likelihood of residuals (n, k) at these reaches and rates."""
    square = (left**2).mean(1)
    start = np.sqrt(np.median(square))

    def cost(log: Array) -> float:
        variance = sigma_of(_law(log), reach_m, rate_rad_s) ** 2
        return float((np.log(variance) + square / variance).mean())

    guess = np.log([start, start / np.median(reach_m), start / max(np.median(rate_rad_s), 1e-3)])
    best = minimize(cost, guess, method="Nelder-Mead", options={"maxiter": 4000, "xatol": 1e-4, "fatol": 1e-8})
    law = _law(best.x)
    ratio = square / sigma_of(law, reach_m, rate_rad_s) ** 2
    own = [(np.log(ratio[flights == f].mean()) / 2.0, (flights == f).sum()) for f in np.unique(flights)]
    logs = np.array([log for log, n in own if n >= LEAST_FRAMES])
    chance = np.mean([0.5 / (n * left.shape[1]) for _, n in own if n >= LEAST_FRAMES])  # of a flight's few frames
    return law._replace(spread=float(np.sqrt(max(logs.var(ddof=1) - chance, 0.0))) if len(logs) > 1 else 0.0)


# -- missed and false ------------------------------------------------------------------------------------------------
def missed_law(c: dict[str, Array], max_height_m: float) -> MissedLaw:
    """Hidden shares by flight from its easy frames, then the probit of greatest likelihood of the rest.

    InputError where there are too few easy frames.
    """
    used = (c["whole"] > 0.0) & (c["reach_m"] <= max_height_m)
    low_m = max(0.5 * max_height_m, float(np.quantile(c["reach_m"][used], EASY_PART)))
    easy = used & (c["image_rate_rad_s"] < EASY_RATE_RAD_S) & (c["reach_m"] <= low_m)
    missed = 1.0 - c["found"]
    flights = [f for f in np.unique(c["flight"][used]) if (easy & (c["flight"] == f)).sum() >= LEAST_FRAMES]
    if not flights:
        raise InputError(f"pad: too few slow frames from below; give more {arg('frames')}")
    counts = np.array([(easy & (c["flight"] == f)).sum() for f in flights])
    shares = hidden_shares(np.array([missed[easy & (c["flight"] == f)].sum() for f in flights]), counts)
    by_flight = dict(zip(flights, shares, strict=True))
    own = np.array([by_flight.get(f, float(shares.mean())) for f in c["flight"][used]])
    h, w, lost = c["reach_m"][used] / max_height_m, c["image_rate_rad_s"][used], missed[used]

    def probabilities(p: Array) -> Array:
        return np.asarray(own + (1.0 - own) * norm.cdf(np.exp(p[1]) * h + np.exp(p[2]) * w - p[0]))

    def cost(p: Array) -> float:
        chance = np.clip(probabilities(p), 1e-6, 1.0 - 1e-6)
        unlikely = 1e-3 * float((p[1:] ** 2).sum() + (p[0] - 2.0) ** 2)  # holds numbers that no frame shows
        return -float((lost * np.log(chance) + (1.0 - lost) * np.log(1.0 - chance)).mean()) + 1e-2 * unlikely

    best = minimize(cost, np.array([2.5, 0.0, -1.0]), method="Nelder-Mead", options={"maxiter": 4000}).x
    blur = float(np.quantile(w, 0.9))
    share, far, fast = (
        float(np.clip(norm.cdf(x), SHARE_FLOOR, 0.99))
        for x in (-best[0], np.exp(best[1]) - best[0], np.exp(best[2]) * blur - best[0])
    )
    return MissedLaw(share, far, fast, blur, beta_of(shares, counts))


def hidden_shares(missed: Array, counts: Array) -> Array:
    """Share of its easy frames that a flight misses beyond the median flight's share, as a part of the rest of them.

    None where the median flight might miss as many by chance once in a hundred flights.
    """
    usual = float(np.median(missed / counts))
    unlikely = binom.sf(missed - 1, counts, max(usual, 0.5 / counts.sum())) < UNLIKELY_PROBABILITY
    return np.where(unlikely, (missed / counts - usual) / (1.0 - usual), 0.0)


def beta_of(shares: Array, counts: Array) -> tuple[float, float]:
    """A beta distribution with the shares' mean and spread between flights, that of few frames taken off."""
    mean = float(np.clip((shares @ counts + 0.5) / (counts.sum() + 1.0), 1e-4, 0.99))
    chance = mean * (1.0 - mean) * float(np.mean(1.0 / counts))
    most = mean * (1.0 - mean)
    variance = float(np.clip(shares.var(ddof=1) - chance if len(shares) > 1 else 0.0, 0.01 * most, 0.9 * most))
    both = most / variance - 1.0
    return mean * both, (1.0 - mean) * both


def false_share_of(c: dict[str, Array]) -> float:
    """The mean of what the count of wrong fixes allows (Laplace's rule: none of n is one of n + 2)."""
    return float((c["wrong"].sum() + 1.0) / (len(c["wrong"]) + 2.0))


def heights_in_range(c: dict[str, Array]) -> tuple[float, float]:
    """The lowest height and the greatest reach at which half of the slowest frames with the whole pad give a fix.

    Reaches are taken together in steps of a fifth. InputError where there is no such height.
    """
    slow = (c["speed_m_s"] == c["speed_m_s"].min()) & (c["whole"] > 0.0)
    step = np.round(np.log(c["reach_m"]) / np.log(REACH_STEP))
    low = [float(h) for h in np.unique(c["height_m"]) if _mostly_found(c, slow & (c["height_m"] == h))]
    far = [float(REACH_STEP**k) for k in np.unique(step) if _mostly_found(c, slow & (step == k))]
    if not low or not far:
        raise InputError("pad: no height at which half of the frames with the whole pad in view give a fix")
    return low[0], far[-1]


def _mostly_found(c: dict[str, Array], own: NDArray[np.bool_]) -> bool:
    return bool(own.sum() >= LEAST_FRAMES and c["found"][own].mean() >= LEAST_SHARE)


def laws_of(frames: Sequence[TrialFrame]) -> tuple[PadLaws, list[Cell]]:
    """The sensor that frames describe, and what was measured by height and speed. InputError where they are too few."""
    c = columns_of(frames)
    low, high = heights_in_range(c)
    biases, angle, distance, left = biases_and_laws(c)
    own = np.array(list(biases.values()))
    bias, scale = float(np.sqrt((own[:, :2] ** 2).mean())), float(np.sqrt((own[:, 2:] ** 2).mean()))
    missed, flights = missed_law(c, high), len(np.unique(c["flight"]))
    laws = PadLaws(low, high, angle, distance, bias, scale, missed, false_share_of(c), len(frames), flights)
    return laws, cells_of(frames, c, left)


def cells_of(frames: Sequence[TrialFrame], c: dict[str, Array], left: Array) -> list[Cell]:
    """By height and speed."""
    cells = []
    for height_m in np.unique(c["height_m"]):
        for speed_m_s in np.unique(c["speed_m_s"]):
            own = (c["height_m"] == height_m) & (c["speed_m_s"] == speed_m_s)
            seen = own & (c["whole"] > 0.0)
            rest = left[own][np.isfinite(left[own]).all(1)]
            enough = len(rest) >= LEAST_FRAMES
            angle, distance, heading = (_rms(rest[:, k]) if enough else np.nan for k in (slice(0, 2), 2, 3))
            reasons = Counter(f.reason for f, k in zip(frames, own, strict=True) if k and not f.found)
            cells.append(
                Cell(
                    float(height_m),
                    float(speed_m_s),
                    float(np.median(c["image_rate_rad_s"][own])),
                    int(own.sum()),
                    int(seen.sum()),
                    int(c["found"][seen].sum()),
                    int(c["wrong"][own].sum()),
                    angle,
                    distance,
                    heading,
                    dict(reasons),
                )
            )
    return cells


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))
