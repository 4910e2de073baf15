"""The CUDA engine, whatever runs its threads: parts in order, flights that fit, truths drawn meanwhile."""

from __future__ import annotations

import numpy as np
import pytest

import device_cases
from flownav.campaigns import cuda
from flownav.campaigns.cuda import Cuda, most_that_fit, truths_of, truths_of_cell
from flownav.campaigns.engines import Part
from flownav.campaigns.measures import ROW_COLUMNS
from flownav.campaigns.plan import Ready, ready_of
from flownav.core.errors import InputError
from flownav.simulation import layout
from flownav.simulation.truth import SOUND, TRUTH_ROWS

SHORT = {"filter": {"name": "paper"}, "flight": {"duration_s": 1.0}}
NUMBER = ROW_COLUMNS.index("x.mean_error")


class Counting:
    """A device whose flights score their own numbers."""

    in_python = False

    def __init__(self, free=1 << 30):
        self.free, self.launched, self.truths = free, [], []

    def free_bytes(self):
        return self.free

    def put(self, value):
        return value

    def new(self, shape, dtype):
        return np.zeros(shape, dtype)

    def fetch(self, array):
        return array

    def run(self, function, threads, told, constants):
        self.launched.append((told["first"], threads, told["truth"].size // TRUTH_ROWS))
        self.truths.append(told["truth"])
        told["scores"][NUMBER] = told["first"] + np.arange(threads)


@pytest.fixture(scope="module")
def cells():
    """The same short landing, matched and with truths of its own."""
    setup = device_cases.ready("gusty", SHORT)
    return {model: ready_of(setup, model, "plain", 100) for model in ("matched", "ensemble")}


def test_parts_come_in_order_and_gaps_are_not_flown(cells):
    device, told = Counting(), []
    parts = [Part(0, 0, 8), Part(1, 8, 8), Part(4, 32, 5)]
    flown = list(Cuda(device, at_once=10).fly(cells["matched"], 1, parts, told.append))
    assert [part for part, _ in flown] == parts
    for part, rows in flown:
        assert rows[:, NUMBER].tolist() == list(range(part.first, part.first + part.flights))
    assert [launch[:2] for launch in device.launched] == [(0, 10), (10, 6), (32, 5)]
    assert sum(told) == 21


def test_matched_flights_share_one_truth_and_drawn_ones_have_their_own(cells):
    device = Counting()
    for model in ("matched", "ensemble"):
        list(Cuda(device).fly(cells[model], 1, [Part(0, 0, 8)]))
    assert [columns for _, _, columns in device.launched] == [1, 8]


def test_each_launch_flies_the_truths_of_its_flights(cells):
    device, cell = Counting(), cells["ensemble"]
    list(Cuda(device, at_once=4).fly(cell, 1, [Part(0, 3, 10)]))
    truths = truths_of(cell.flight, 1, cell.ensemble)
    for (first, count, _), given in zip(device.launched, device.truths, strict=True):
        assert np.array_equal(given, truths(first, count).reshape(-1), equal_nan=True)


def test_no_more_flights_at_once_than_memory_holds(cells):
    device = Counting(free=1 << 20)
    fit = most_that_fit(device.free, cells["matched"].flight)
    list(Cuda(device).fly(cells["matched"], 1, [Part(0, 0, 3 * fit)]))
    assert 0 < fit < 128
    assert [threads for _, threads, _ in device.launched] == [fit] * 3
    with pytest.raises(InputError, match="no memory left"):
        list(Cuda(Counting(free=1000)).fly(cells["matched"], 1, [Part(0, 0, 1)]))


def test_other_processes_draw_the_same_truths(cells, monkeypatch):
    monkeypatch.setattr(cuda, "WORTH_IT", 1)
    monkeypatch.setattr(cuda, "SLICE_FLIGHTS", 16)
    cell = cells["ensemble"]
    alone = truths_of(cell.flight, 7, cell.ensemble)(30, 50)
    with truths_of_cell(cell, 7, 50, 2) as truths:
        assert np.array_equal(truths(30, 50), alone, equal_nan=True)
    assert alone.shape == (TRUTH_ROWS, 50)
    assert len(np.unique(np.nan_to_num(alone), axis=1).T) == 50


class Biased:
    """A failure whose bias is the flight's number."""

    words = "its number"

    def law(self, flight, seed, number):
        return SOUND._replace(bias_0=float(seed * number))


def test_each_flight_has_its_own_fault(cells):
    given = {name: getattr(cells["matched"], name) for name in ("setup", "truth_model", "sampling", "flights")}
    cell = Ready(**given, ensemble=None, failure=Biased())
    with truths_of_cell(cell, 10, 3, 4) as truths:
        packed = truths(5, 3)
    assert packed.shape == (TRUTH_ROWS, 3)
    bias = layout.AS_IS["fault"] - layout.AS_IS_BEGIN + SOUND._fields.index("bias_0")
    assert packed[bias].tolist() == [50.0, 60.0, 70.0]
