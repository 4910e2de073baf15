"""The skid switch: thresholds, debounce, a stuck one, its datasheet; and the bundle of all datasheets."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flownav.core.errors import InputError
from flownav.core.parameter_files import check, shipped
from flownav.sensors.sheets import SensorSheets, shipped_sheets
from flownav.sensors.skid_switch import (
    SkidSwitchNormals,
    SkidSwitchSheet,
    SkidSwitchUnit,
    draw_skid_switch,
    start_skid_switch,
    step_skid_switch,
)
from sensor_normals import draws, silent

SHEET = SkidSwitchSheet.read()
P = SHEET.parameters(80.0)  # closes at 12 N, opens below 8 N, follows after 5 readings
WORKING, QUIET = SkidSwitchUnit(0.0, 0.0), silent(SkidSwitchNormals)


def reported(loads: list[float], unit: SkidSwitchUnit = WORKING, start_n: float = 0.0) -> list[float]:
    state, out = start_skid_switch(start_n, P), []
    for load in loads:
        state, reading = step_skid_switch(state, unit, load, QUIET, P)
        assert reading[1:] == (255.0, 1.0)
        out.append(reading.landed)
    return out


def test_it_follows_after_the_debounce() -> None:
    assert reported([12.1] * 8) == [0.0] * 4 + [1.0] * 4
    assert reported([0.0] * 8, start_n=80.0) == [1.0] * 4 + [0.0] * 4
    assert reported([0.0] * 3 + [80.0] * 5) == [0.0] * 7 + [1.0]  # only readings that say otherwise count


def test_it_closes_at_one_load_and_opens_at_another() -> None:
    assert set(reported([11.9] * 20)) == {0.0}
    assert reported([20.0] * 5 + [8.1] * 20)[-1] == 1.0
    assert reported([20.0] * 5 + [7.9] * 20)[-1] == 0.0


def test_bounces_are_ignored() -> None:
    assert set(reported([80.0, 80.0, 80.0, 80.0, 0.0] * 6)) == {0.0}


def test_a_stuck_switch_says_one_thing() -> None:
    assert set(reported([80.0] * 20, SkidSwitchUnit(1.0, 0.0))) == {0.0}
    assert set(reported([0.0] * 20, SkidSwitchUnit(0.0, 1.0))[5:]) == {1.0}
    p = SHEET.model_copy(update={"stuck_open_share": 0.1, "stuck_closed_share": 0.05}).parameters(80.0)
    units = np.array([draw_skid_switch(n, p) for n in draws(SkidSwitchUnit, 6000, 21)])
    np.testing.assert_allclose(units.mean(axis=0), [0.1, 0.05], atol=0.015)
    assert not np.any(units.sum(axis=1) > 1.0)
    assert draw_skid_switch(SkidSwitchUnit(8.6, 8.6), P) == draw_skid_switch(SkidSwitchUnit(-8.6, 8.6), P) == WORKING


def test_the_load_is_noisy() -> None:
    state = start_skid_switch(0.0, P)
    above, _ = step_skid_switch(state, WORKING, 10.0, SkidSwitchNormals(1.0, 0.0), P)
    below, _ = step_skid_switch(state, WORKING, 10.0, SkidSwitchNormals(0.8, 0.0), P)
    assert (above.contact, below.contact) == (1.0, 0.0)  # 2.4 N is one sigma


@pytest.mark.parametrize(("debounce_s", "readings"), [(0.0, 1.0), (0.02, 1.0), (0.021, 2.0), (0.1, 5.0)])
def test_the_debounce_is_in_whole_readings(debounce_s: float, readings: float) -> None:
    assert SHEET.model_copy(update={"debounce_s": debounce_s}).parameters(80.0).debounce_readings == readings


def test_what_the_datasheet_refuses() -> None:
    with pytest.raises(InputError, match=r"^s: opening_share: at most closing_share = 0\.15 is needed"):
        check(SHEET.model_dump() | {"opening_share": 0.2}, SkidSwitchSheet, "s")


def test_every_shipped_datasheet_loads_and_names_its_sources() -> None:
    sheets = shipped_sheets()
    for name, sheet in sheets:
        assert sheet is not None, name
        if name != "magnetic_field":
            assert sheet.name
            assert sheet.provenance
    files = {path.stem for path in Path(shipped("sensors")).glob("*.toml")}
    assert files == {name for name, _ in sheets} - {"flow_sensor", "magnetic_field"} | {"range_lidar"}


def test_only_the_imu_must_be_there_and_sheets_are_frozen() -> None:
    sheets = SensorSheets(inertial=shipped_sheets().inertial)
    assert sheets.gps_receiver is None
    with pytest.raises(ValueError, match="frozen"):
        sheets.gps_receiver = None  # type: ignore[misc]
    with pytest.raises(InputError, match=r"^vehicle: inertial: missing; add it"):
        check({}, SensorSheets, "vehicle")
