"""Scores kept as a flight flies are those that its history gives."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.scoring.consistency import largest_horizontal_error
from flownav.scoring.errors import SCORE_COLUMNS, score_block
from flownav.scoring.running import RUNNING_COLUMNS, RUNNING_ROWS, Shown, Terms, begin_scores, note_shown, write_scores
from flownav.scoring.touchdown import Limits, motion_of, touchdowns

EPOCH_S, ABOVE_SKID_M, EPOCHS, LANES = 0.02, 0.4, 260, (0,) * 12
LIMITS = Limits(0.8, 0.9, 12.0, 20.0, 0.3)


def random_flights(seed):
    """A block of motions that touch, bounce, slide, come to rest, go around and roll over; as arrays by name."""
    draw = np.random.default_rng(seed)
    lanes, t = len(LANES), np.arange(EPOCHS)[:, None]
    first, leaves = draw.integers(20, 200, lanes), draw.integers(10, 300, lanes)
    touches = (t >= first) & ~((t >= first + leaves) & (t < first + leaves + draw.integers(5, 60, lanes)))
    touches ^= draw.random((EPOCHS, lanes)) < 0.01
    begins = draw.integers(0, 300, lanes)
    away = (t >= begins) & (t < begins + draw.integers(1, 40, lanes))
    calm = np.where(t >= draw.integers(150, 320, lanes), 1e-4, 0.5)
    quaternion = np.stack([np.ones((EPOCHS, lanes)), *(0.1 * draw.normal(size=(3, EPOCHS, lanes)) * calm)], axis=1)
    quaternion[draw.integers(0, EPOCHS), 1, draw.integers(0, lanes)] = 0.5
    quaternion /= np.sqrt((quaternion**2).sum(axis=1, keepdims=True))
    position = np.cumsum(0.04 * draw.normal(size=(EPOCHS, 3, lanes)) * calm[:, None], axis=0)
    position[:, 2] -= 0.1 + 0.5 * draw.random(lanes)
    return {
        "position": position,
        "velocity": draw.normal(size=(EPOCHS, 3, lanes)) * calm[:, None],
        "quaternion": quaternion,
        "yaw_rate": 0.6 * draw.normal(size=(EPOCHS, lanes)) * calm,
        "touches": touches,
        "away": away.astype(float),
        "error": 0.1 * draw.normal(size=(EPOCHS, 6, lanes)) + 0.2,
        "ground": np.zeros((EPOCHS, lanes)) - 0.2 * (draw.random(lanes) < 0.5),
        "counts": draw.random((EPOCHS, lanes)) < np.where(draw.random(lanes) < 0.2, 0.0, 0.9),
        "seen": draw.random((EPOCHS, lanes)) < 0.1,
    }


def kept_as_they_fly(f, home, may_land_after_s):
    """The rows that running scores give."""
    work, scores = np.full(RUNNING_ROWS * len(LANES), np.nan), np.full((RUNNING_COLUMNS, len(LANES)), np.nan)
    begin_scores(work, LANES, 0)
    for k in range(EPOCHS):
        for lane in range(len(LANES)):
            touches, counts = bool(f["touches"][k, lane]), bool(f["counts"][k, lane])
            shown = Shown(
                *f["position"][k, :, lane], *f["velocity"][k, :, lane], *f["quaternion"][k, :, lane],
                f["yaw_rate"][k, lane], f["ground"][k, lane], touches, f["away"][k, lane] > 0.0,
                *f["error"][k, :, lane], *f["error"][k, :2, lane], counts, not touches and k >= home,
                bool(f["seen"][k, lane]), k == home,
            )  # fmt: skip
            note_shown(work, LANES, 0, lane, k, shown, ABOVE_SKID_M)
    terms = Terms(EPOCHS, EPOCH_S, may_land_after_s, LIMITS)
    for lane in range(len(LANES)):
        write_scores(work, LANES, 0, lane, terms, scores, lane)
    return scores.T


def of_history(f, home, may_land_after_s):
    """The rows that the histories give."""
    motion = motion_of(
        f["position"], f["velocity"], f["quaternion"], f["yaw_rate"], f["touches"].astype(float), ABOVE_SKID_M
    )
    motion = motion._replace(cg_height_m=motion.cg_height_m - f["ground"])
    t_s = np.arange(EPOCHS) * EPOCH_S
    landing = touchdowns(t_s, motion, f["error"][:, :2], f["seen"].astype(float), f["away"], LIMITS, may_land_after_s)
    truth = np.concatenate([f["position"], f["velocity"]], axis=1)
    scores = score_block(truth + f["error"], truth, landing, f["counts"].astype(float))
    counted = f["counts"] * ~f["touches"] * (np.arange(EPOCHS)[:, None] >= max(home, 0))
    largest = largest_horizontal_error(
        truth[:, :3] + f["error"][:, :3], truth[:, :3], home if home >= 0 else None, counted.astype(float)
    )
    return np.column_stack([scores, largest])


@pytest.mark.filterwarnings("ignore:invalid value encountered")
@pytest.mark.parametrize("home", [-1, 0, 30])
@pytest.mark.parametrize("seed", range(4))
def test_a_flight_scores_the_same_as_it_flies_and_from_its_history(seed, home):
    flights = random_flights(seed)
    rows, told = kept_as_they_fly(flights, home, 2.0), of_history(flights, home, 2.0)
    names = [*SCORE_COLUMNS, "largest_horizontal_m"]
    wrong = [name for name, a, b in zip(names, rows.T, told.T, strict=True)
             if not np.allclose(a, b, rtol=1e-12, atol=1e-12, equal_nan=True)]  # fmt: skip
    assert wrong == []


def test_the_flights_of_this_test_do_all_that_is_scored():
    """A test of what never happens would show nothing."""
    rows = np.concatenate([of_history(random_flights(seed), -1, 2.0) for seed in range(4)])
    of = {name: rows[:, i] for i, name in enumerate(SCORE_COLUMNS)}
    broken = of["touchdown.broken"].astype(int)
    assert all(((broken >> bit) & 1).any() for bit in range(8))
    assert (broken == 0).any() or np.isfinite(of["touchdown.rest.t_s"]).any()
    assert np.isfinite(of["touchdown.rest.t_s"]).any()
    assert np.isnan(of["touchdown.contact.t_s"]).any()
    assert (of["touchdown.go_arounds"] > 0.0).any()
    assert of["touchdown.aloft"].any()
    assert np.isnan(of["x.std_error"]).any()
