"""The library's size: bytes of code and RAM, stack, and instructions of every call on an emulated Cortex-M7."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from flownav.core.errors import InputError
from flownav.core.measurement import Sensor, Stream
from flownav.export.onboard.board import NOTHING, Board
from flownav.export.onboard.code import WITHOUT
from flownav.export.onboard.interface import Rates
from flownav.export.onboard.library_boards import LibraryBoard, library_board
from flownav.export.onboard.package import Asked, code_of
from flownav.export.onboard.targets import TARGETS
from flownav.navigation import progress, waiting
from flownav.navigation.memory import PAD_KNOWN
from flownav.navigation.pad import STOOD_ON
from flownav.navigation.rings import Given, numbers_of
from navigation_streams import circle, fly
from onboard_readings import RATES, arriving, flight_of, settings_of, spoilt

KIB = 1024
MOST_CODE, MOST_RAM, MOST_STACK = 96 * KIB, 24 * KIB, 4 * KIB
MOST_A_CALL, MOST_A_SECOND = 150_000, 12e6
FLOWN = fly(circle, 12.0, 0.2)
SETTINGS, _ = settings_of(flight_of(FLOWN))


def counted(board: LibraryBoard, readings: Sequence[Given]) -> list[int]:
    """Instructions of each call."""
    board.count()
    found = []
    for given in readings:
        before = board.instructions
        board.take(given)
        found.append(board.instructions - before)
    return found


@pytest.mark.parametrize("target", TARGETS)
def test_code_fits(target):
    code = code_of(Asked(target), False)
    assert 30 * KIB < code.code_bytes + code.constant_bytes < (136 if target == "linux-x86_64" else 96) * KIB


def test_ram_of_a_navigator_fits_at_usual_rates():
    assert 8 * (progress.BOARD_ROWS + waiting.rows_of(Rates().sizes)) <= MOST_RAM
    flown = Rates(others_hz=185.0, exposure_s=0.02)  # as `pad_return` has them
    assert 8 * (progress.BOARD_ROWS + waiting.rows_of(flown.sizes)) <= MOST_RAM
    assert waiting.rows_of(Rates(imu_hz=400.0).sizes) > waiting.rows_of(Rates(imu_hz=100.0).sizes)


@pytest.mark.parametrize("sensors", ["all", "flow and range alone"])
def test_no_call_on_a_cortex_m7_takes_longer_than_it_may(sensors, tmp_path):
    flown = FLOWN if sensors == "all" else FLOWN.only(Sensor.IMU, Sensor.FLOW_RATE, Sensor.RANGE, Sensor.ATTITUDE)
    settings, _ = settings_of(flight_of(flown))
    board = library_board("cortex-m7", settings, RATES.sizes, tmp_path)
    readings = arriving(flown)[:1200]
    calls = counted(board, readings)
    assert max(calls) <= MOST_A_CALL
    assert sum(calls) / (readings[-1].t_s - readings[0].t_s) <= MOST_A_SECOND
    assert board.stack_bytes <= MOST_STACK
    assert sum(calls) > 1e6  # it was counted


def test_a_report_of_landed_takes_no_longer_where_it_ties_the_vehicle_to_its_pad(tmp_path):
    stood = fly(lambda t_s: np.column_stack([0.0 * t_s, 0.0 * t_s, 0.0 * t_s - 0.1]), 6.0)
    t_s = np.arange(0.5, 6.0, 0.25)
    landed = stood.added(Stream.of(Sensor.LANDED, t_s, np.ones((len(t_s), 1))))
    settings, _ = settings_of(flight_of(landed))
    board, here = library_board("cortex-m7", settings, RATES.sizes, tmp_path), Board(settings, RATES.sizes)
    readings = arriving(landed)
    calls = counted(board, readings)
    assert max(calls) <= MOST_A_CALL
    for given in readings:
        here.take(given)
    assert board.digest() == here.digest()
    assert here.work[PAD_KNOWN] == STOOD_ON


def test_a_gap_a_leap_and_garbage_take_no_longer(tmp_path):
    board = library_board("cortex-m7", SETTINGS, RATES.sizes, tmp_path)
    readings = arriving(FLOWN)
    for given in readings[:500]:
        board.take(given)
    now_s = readings[499].t_s
    late = [Given(now_s - 1000.0, int(Sensor.IMU), numbers_of((0.0,) * 6))]
    gap = [
        Given(now_s + 9.0 + 0.01 * k, int(Sensor.IMU), numbers_of((0.0, 0.0, 0.0, 0.0, 0.0, -9.8))) for k in range(60)
    ]
    anew = [given._replace(t_s=given.t_s + 1000.0) for given in readings[:60]]
    garbage = [given for seed in range(6) for given in spoilt(readings[500:540], seed)]
    calls = counted(board, [*late, *gap, *anew, *garbage, *[NOTHING] * 20])
    assert max(calls) <= MOST_A_CALL
    assert board.stack_bytes <= MOST_STACK
    before = board.instructions
    board.now(now_s)
    assert board.instructions - before <= MOST_A_CALL


@pytest.mark.parametrize("imu_hz", [250.0, 400.0])
def test_faster_inertial_readings(imu_hz, tmp_path):
    imu = FLOWN.streams[Sensor.IMU]
    t_s = np.arange(0.0, 5.0, 1.0 / imu_hz)
    value = np.column_stack([np.interp(t_s, imu.t_s, column) for column in imu.value.T])
    flown = FLOWN.changed(
        Sensor.IMU, t_s=t_s, value=value, variance=np.full((len(t_s), 6), np.nan), quality=255.0 + 0 * t_s
    )
    rates = RATES._replace(imu_hz=imu_hz)
    board = library_board("cortex-m7", SETTINGS, rates.sizes, tmp_path)
    readings = [given for given in arriving(flown) if given.t_s < 4.0]
    calls = counted(board, readings)
    assert max(calls) <= MOST_A_CALL
    assert sum(calls) / 4.0 <= MOST_A_SECOND + 20e3 * (imu_hz - 100.0)  # a step of the filter each


# -- what is left out ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "part", [each if each == "protection" else pytest.param(each, marks=pytest.mark.slow) for each in WITHOUT]
)
def test_what_is_left_out_is_less_code(part):
    whole, less = (code_of(Asked("cortex-m7", without=without), False) for without in ((), (part,)))
    assert less.code_bytes < whole.code_bytes - 1000


def test_a_part_that_is_none():
    with pytest.raises(InputError, match="without wheels: choose from protection, pad, course"):
        code_of(Asked("cortex-m7", without=("wheels",)), False)


def test_without_protection_the_state_is_the_same_and_no_level_is_kept(tmp_path):
    settings, _ = settings_of(flight_of(FLOWN), without=("protection",))
    less = library_board("cortex-m7", settings, RATES.sizes, Path(tmp_path), without=("protection",))
    here, whole = Board(settings, RATES.sizes), Board(SETTINGS, RATES.sizes)
    readings = arriving(FLOWN)[:900]
    for given in readings:
        for board in (less, here, whole):
            board.take(given)
    assert less.digest() == here.digest()  # Python follows a navigator without it
    assert less.digest() != whole.digest()
    told, expected = less.now(readings[-1].t_s), whole.now(readings[-1].t_s)
    np.testing.assert_array_equal(told.pos_ned_m, expected.pos_ned_m)
    np.testing.assert_array_equal(told.pose_covariance, expected.pose_covariance)
    assert np.isnan(told.protection_m).all()
    assert np.isfinite(expected.protection_m).all()
