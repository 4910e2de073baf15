"""Damaged parameter files of every kind: loaded and sound, or refused with one line; soon, in little."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import isfinite
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from flownav.campaigns.requirement import load_requirement
from flownav.campaigns.requirement import scenario_of as required
from flownav.core.errors import InputError
from flownav.core.parameter_files import load, shipped
from flownav.lab.identification.rig_log import Rig
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.settings_of import settings_of
from flownav.sensors.barometer import BarometerSheet
from flownav.sensors.camera_sheets import FlowCameraSheet, PadCameraSheet
from flownav.sensors.datasheet import load_sensor
from flownav.sensors.magnetometer import MagnetometerSheet
from flownav.sensors.range_sensor import RangeSensorSheet
from flownav.sensors.sheets import GpsReceiverSheet, InertialSheet
from flownav.sensors.skid_switch import SkidSwitchSheet
from flownav.simulation.dispersion import DispersionFile
from flownav.simulation.scenario import load_scenario
from flownav.studies.validation.drawn import load_flights
from flownav.vehicle.kinds import load_vehicle
from flownav.vehicle.linearize import load_paper_model
from fuzzing import FIRST_SEED, MUTANTS, assert_promise
from toml_mutations import mutate_toml

RIG = """schema_version = 1
height_m = 0.6
rod_length_m = 1.5
pivot_height_m = 2.1
encoder_counts_per_revolution = 4096
"""
SETTINGS = """flow_gain_x = { value = 1.02, source = "a rig" }
flow_gain_y = 0.98
gps_slow_sigma_m = 0.8
start_wait_s = 10.0
baro_sigma_m = 0.3
"""


def sensor_as_told(path: Path) -> tuple[Any, ...]:
    """A sensor's file, and the navigator's settings from it."""
    sensor = load_sensor(path)
    return sensor, settings_of(sensor).settings


LOADERS: dict[str, Callable[[Path], Any]] = {
    "maxi_joker_3.toml": load_vehicle,
    "quad_450.toml": load_vehicle,
    "px4flow_paper.toml": sensor_as_told,
    "landing.toml": lambda path: load_scenario(str(path)),
    "approach.toml": lambda path: load_scenario(str(path)),
    "requirements/approach.toml": lambda path: required(load_requirement(str(path))),
    "dispersion.toml": lambda path: load(path, DispersionFile),
    "validation.toml": load_flights,
    "paper_reduced_model.toml": load_paper_model,
    "sensors/gps_receiver.toml": GpsReceiverSheet.read,
    "sensors/range_sensor.toml": RangeSensorSheet.read,
    "sensors/inertial.toml": InertialSheet.read,
    "sensors/flow_camera.toml": FlowCameraSheet.read,
    "sensors/magnetometer.toml": MagnetometerSheet.read,
    "sensors/barometer.toml": BarometerSheet.read,
    "sensors/pad_camera.toml": PadCameraSheet.read,
    "sensors/skid_switch.toml": SkidSwitchSheet.read,
    "rig": lambda path: load(path, Rig),
    "settings": lambda path: load(path, NavigatorSettingsFile),
}
SAMPLES = {"rig": RIG.encode(), "settings": SETTINGS.encode()}


def content_of(name: str) -> bytes:
    return SAMPLES.get(name) or shipped(name).read_bytes()


def numbers_in(found: Any) -> Iterator[float]:
    """Every number of a loaded file, however deep."""
    if isinstance(found, BaseModel):
        yield from numbers_in(found.model_dump())
    elif isinstance(found, dict):
        yield from numbers_in(list(found.values()))
    elif isinstance(found, list | tuple):
        for each in found:
            yield from numbers_in(each)
    elif isinstance(found, float):
        yield found


def assert_finite(found: Any) -> None:
    assert all(map(isfinite, numbers_in(found)))


@pytest.mark.fuzz
@pytest.mark.parametrize("name", LOADERS)
def test_a_damaged_file_is_loaded_or_refused(tmp_path, name):
    path, content, other = tmp_path / "x.toml", content_of(name), content_of("landing.toml")
    for seed in range(FIRST_SEED, FIRST_SEED + -(-MUTANTS // len(LOADERS))):
        changed = mutate_toml(content, other, seed)
        path.write_bytes(changed)
        assert_promise(LOADERS[name], path, len(changed), f"{name}, seed {seed}", assert_finite)


@pytest.mark.parametrize("name", LOADERS)
def test_the_samples_themselves_are_loaded(tmp_path, name):
    (tmp_path / "x.toml").write_bytes(content_of(name))
    assert_finite(LOADERS[name](tmp_path / "x.toml"))


@pytest.mark.parametrize(("name", "said", "instead", "words"), [
    ("quad_450.toml", 'kind = "multirotor"', f"kind = 0x{'f' * 4000}", "kind = something that is too long"),
    ("px4flow_paper.toml", "c_1_s2", "c_1_s2 = 1e-320 #", "greater than or equal to 0.001, got 1e-320"),
])  # fmt: skip
def test_what_damaged_files_found(tmp_path, name, said, instead, words):
    """Seeds 400368 and 403252: a number of 4800 digits could not be printed, and a delay of b/c was infinite."""
    text = content_of(name).decode()
    assert said in text
    (tmp_path / "x.toml").write_text(text.replace(said, instead, 1))
    with pytest.raises(InputError) as told:
        LOADERS[name](tmp_path / "x.toml")
    assert words in str(told.value)
