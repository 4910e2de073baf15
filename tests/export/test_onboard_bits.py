"""The same bits on x86-64, AArch64, a Cortex-M7 and WebAssembly: digests of the library on each, and of replay here."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from flownav.api.building import flight_of as flight_named
from flownav.core.errors import InputError
from flownav.core.measurement import Sensor
from flownav.export.onboard.board import Board
from flownav.export.onboard.library_boards import LibraryBoard, library_board
from flownav.export.onboard.package import Flight, pace_of, packed_settings, rates_of, readings_of
from flownav.export.onboard.targets import TARGETS
from flownav.navigation import progress, waiting
from flownav.navigation.rings import Given
from flownav.studies.compare.job import logs_in
from navigation_streams import circle, fly
from onboard_readings import RATES, arriving, flight_of, settings_of, spoilt

FLOWN = fly(circle, 12.0, 0.2)
FLIGHT = flight_of(FLOWN)
EMULATED = ("linux-aarch64", "cortex-m7", "wasm32")
WITHOUT_SENSORS = {
    "compass": (Sensor.MAG,),
    "GPS": (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY),
    "flow": (Sensor.FLOW_RATE,),
    "range": (Sensor.RANGE,),
    "IMU": (Sensor.IMU,),
}


def same_digests(readings: Sequence[Given], *boards: Board | LibraryBoard, every: int = 200) -> None:
    """All boards say the same of every reading and know the same after it."""
    for count, given in enumerate(readings, 1):
        first, *others = (on.take(given) for on in boards)
        assert all(str(other.head) == str(first.head) for other in others), (count, first.head, others)
        if count % every == 0 or count == len(readings):
            found = {on.digest() for on in boards}
            assert len(found) == 1, count
            told = [on.now(given.t_s) for on in boards]
            for field in told[0]._fields if told[0].status == progress.STATE_GIVEN else ("status",):
                for other in told[1:]:
                    np.testing.assert_array_equal(getattr(other, field), getattr(told[0], field))


@pytest.mark.parametrize("target", TARGETS)
def test_a_library_knows_after_each_reading_what_python_does(target, tmp_path):
    settings, lag = settings_of(FLIGHT)
    assert not lag
    there = library_board(target, settings, RATES.sizes, tmp_path)
    same_digests(arriving(FLOWN)[:1500], there, Board(settings, RATES.sizes))
    assert there.now(7.0).status == progress.STATE_GIVEN


@pytest.mark.parametrize("absent", WITHOUT_SENSORS)
def test_vehicles_that_lack_a_sensor(absent, tmp_path):
    flown = FLOWN.without(*WITHOUT_SENSORS[absent])
    flight = flight_of(flown)
    settings, _ = settings_of(flight)
    rates = rates_of(flight.segment, RATES.horizon_s)
    targets = EMULATED[:2] if absent == "IMU" else EMULATED[1:2]
    boards = [library_board(target, settings, rates.sizes, tmp_path) for target in targets]
    readings = arriving(flown)[:700]
    same_digests(readings, *boards, Board(settings, rates.sizes))
    assert boards[0].now(readings[-1].t_s).status == progress.STATE_GIVEN


@pytest.mark.slow
@pytest.mark.parametrize("target", TARGETS)
def test_the_unit_with_the_sensors_lag_as_states(target, tmp_path):
    settings, lag = settings_of(flight_of(FLOWN, flow_lag_b_1_s=20.0, flow_lag_c_1_s2=150.0))
    assert lag
    boards = library_board(target, settings, RATES.sizes, tmp_path, lag=True), Board(settings, RATES.sizes, lag=True)
    same_digests(arriving(FLOWN)[:1500], *boards)


# -- streams that are spoilt --------------------------------------------------------------------------------
class Restarted:
    """A board that is put back to where it was after some good readings, again and again."""

    def __init__(self, board: Board | LibraryBoard, readings: Sequence[Given]) -> None:
        self.board = board
        for given in readings:
            board.take(given)
        self._rows = self._read("rings", waiting.rows_of(RATES.sizes)).copy()
        self._work = self._read("work", progress.BOARD_ROWS).copy()

    def _read(self, name: str, numbers: int) -> np.ndarray:
        at = getattr(self.board, name)
        return at[:numbers] if isinstance(at, np.ndarray) else self.board.get(at, numbers)

    def again(self) -> Board | LibraryBoard:
        """As it was."""
        for name, values in (("work", self._work), ("rings", self._rows)):
            at = getattr(self.board, name)
            if isinstance(at, np.ndarray):
                at[: len(values)] = values
            else:
                self.board.put(at, values)
        return self.board


def spoilt_everywhere(seeds: Sequence[int], targets: Sequence[str], folder: Path) -> None:
    settings, _ = settings_of(FLIGHT)
    readings = arriving(FLOWN)
    good, rest = readings[:500], readings[500:560]
    boards = [Restarted(Board(settings, RATES.sizes), good)]
    boards += [Restarted(library_board(target, settings, RATES.sizes, folder), good) for target in targets]
    digests = set()
    for seed in seeds:
        now = [board.again() for board in boards]
        same_digests(spoilt(rest, seed), *now, every=30)
        digests.add(now[0].digest())
    assert len(digests) > len(seeds) // 3  # they were spoilt in different ways; those that begin anew end alike


def test_spoilt_streams_end_in_the_same_bits(tmp_path):
    spoilt_everywhere(range(0, 200, 8), EMULATED, tmp_path)


@pytest.mark.slow
def test_two_hundred_spoilt_streams_end_in_the_same_bits(tmp_path):
    spoilt_everywhere(range(200), TARGETS, tmp_path)


# -- flights that were recorded --------------------------------------------------------------------------------
def flown_everywhere(flight: Flight, most: int, targets: Sequence[str], folder: Path) -> None:
    rates = rates_of(flight.segment, 0.27)
    settings, lag = packed_settings(flight, pace_of(flight.settings, rates.horizon_s))
    boards = [library_board(target, settings, rates.sizes, folder, lag=lag) for target in targets]
    same_digests(readings_of(flight)[:most], *boards, Board(settings, rates.sizes, lag=lag), every=1000)


def logs(folder: Path) -> list[Flight]:
    found = []
    for path in logs_in(folder):
        try:
            found.append(flight_named(path))
        except InputError:  # what flownav sent to the vehicle, and a log without GPS and flow, cannot be replayed
            assert path.name in ("from_flownav.tlog", "sample_appended_multiple.ulg")
    return found


def test_a_recorded_flight(data_folder, tmp_path):
    flown_everywhere(
        flight_named(data_folder / "dataflash/heli_sitl_takeoff_square_land.bin"), 1200, EMULATED, tmp_path
    )


@pytest.mark.slow
def test_all_recorded_flights(data_folder, tmp_path):
    flights = logs(data_folder)
    assert len(flights) >= 20
    for flight in flights:
        flown_everywhere(flight, 10**9, ("linux-x86_64", "wasm32"), tmp_path)
        flown_everywhere(flight, 20_000, ("linux-aarch64", "cortex-m7"), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["pad_return", "takeoff", "landing", "approach", "gusty"])
def test_all_shipped_scenarios(scenario, tmp_path):
    from flownav import fly as flown

    flown(scenario).save(tmp_path / "record.fnr")
    flown_everywhere(flight_named(tmp_path / "record.fnr"), 10**9, tuple(TARGETS), tmp_path)
