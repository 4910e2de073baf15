"""Tables as data frames and back, what objects show of themselves, and changes of scenario, vehicle and sensor."""

from __future__ import annotations

import copy
import pickle
import re
import sys

import numpy as np
import polars
import pytest

import flownav
from flownav.api.table import unit_of
from flownav.core.errors import InputError
from flownav.core.measurement import COLUMNS
from flownav.core.record import TABLES

DIMENSIONLESS = re.compile(
    r"q[wxyz]|on_ground|nees|test_ratio|fused|value.*|flow_scale|tan_.*|landed|quality|withheld|arrived|segment"
    r"|away|pad_seen|counted|sees_flow|flagged|sensor|component|observation.*|innovation.*|reason|source|kind|detail"
    r"|std_flow_scale|variance_.*"
)


@pytest.fixture(scope="module")
def record():
    return flownav.fly("landing", seed=1, flight={"duration_s": 8.0})


def test_every_frame_holds_the_columns_of_every_table_to_the_bit(record):
    for name in record:
        table = record[name]
        pandas_frame, polars_frame, dataset = table.to_pandas(), table.to_polars(), table.to_xarray()
        assert pandas_frame.index.name == "t_s"
        assert polars_frame.columns[0] == "t_s"
        assert set(dataset.sizes) == {"t_s"}
        for column, values in table.items():
            of_pandas = pandas_frame.index.to_numpy() if column == "t_s" else pandas_frame[column].to_numpy()
            for found in (of_pandas, polars_frame[column].to_numpy(), dataset[column].values):
                if values.dtype.kind == "f":
                    assert np.array_equal(found, values, equal_nan=True), (name, column)
                else:
                    assert found.tolist() == values.tolist(), (name, column)


def test_units_stand_in_the_data_sets_as_in_the_names(record):
    dataset = record.estimate.to_xarray()
    assert dataset["vel_u_m_s"].attrs["units"] == "m/s"
    assert dataset["t_s"].attrs["units"] == "s"
    assert "units" not in dataset["qw"].attrs
    assert record.truth.units()["rate_p_rad_s"] == "rad/s"


@pytest.mark.parametrize(
    "column",
    sorted({column for columns in (*TABLES.values(), *COLUMNS.values()) for column in columns}),
)
def test_every_column_that_has_a_unit_says_it(column):
    assert (unit_of(column) == "") == bool(DIMENSIONLESS.fullmatch(column)), column


def test_a_column_that_is_not_there_names_those_that_are(record):
    with pytest.raises(KeyError, match=r"estimate has no column 'pos_n'; it has: t_s, pos_n_m, pos_e_m"):
        record.estimate["pos_n"]
    with pytest.raises(KeyError, match=r"no table 'estimates'; it has: truth, command"):
        record["estimates"]
    with pytest.raises(AttributeError, match=r"no table 'estimates'; it has: truth, command"):
        record.estimates  # noqa: B018
    assert "estimate" in record
    assert "estimate" in dir(record)


@pytest.mark.parametrize("library", ["pandas", "xarray", "polars"])
def test_a_library_that_is_missing_is_named_with_its_command(record, library, monkeypatch):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(InputError, match=rf'^{library} is not installed; python -m pip install "flownav\[frames\]"'):
        getattr(record.estimate, f"to_{library}")()


def test_a_polars_frame_and_a_data_set_are_taken_as_estimates(record):
    for frame in (record.flown.to_polars(), record.flown.to_xarray(), record.flown.to_pandas().reset_index()):
        assert record.rescore(estimate=frame).scores == record.scores
    arrow = polars.DataFrame(dict(record.flown)).to_arrow()
    assert record.rescore(estimate=arrow).scores == record.scores


# -- how they show themselves -----------------------------------------------------------------------------------------
def test_a_record_is_shown_in_two_lines_and_as_a_table_of_escaped_text(record):
    lines = repr(record).splitlines()
    assert len(lines) <= 2
    assert lines[0].startswith(
        "<Record fly landing, seed 1 flight 0, filter landing, 8.0 s: largest error of one axis 0."
    )
    assert "truth, command, flown" in lines[1]
    assert len(record._repr_html_()) < 5000
    nasty = flownav.Record({"kind": "replay", "log": "<script>alert(1)</script>", "duration_s": 1.0}, {})
    assert "<script>" not in nasty._repr_html_()
    assert "&lt;script&gt;" in nasty._repr_html_()
    assert repr(flownav.Record()).startswith("<Record ? nothing, filter ?: not scored")
    own = flownav.Record({"kind": "fly", "filter": "landing", "parts": {"controller": "Mine", "sensors": ["A", "B"]}})
    assert "filter landing, own sensors A, B, own controller Mine:" in repr(own)


@pytest.mark.parametrize("what", ["position", "velocity", "errors", "innovations", "path"])
def test_every_plot_draws_finite_numbers(record, what):
    figure = record.plot(what)
    drawn = [np.asarray(trace.y if what != "path" else trace.z, float) for trace in figure.data]
    assert drawn
    assert all(np.isfinite(values).any() for values in drawn)
    assert len(figure.to_json()) < 4_000_000


def test_errors_are_drawn_while_they_are_scored(record):
    figure = record.plot("errors")
    line = next(trace for trace in figure.data if trace.name == "estimate")
    error = np.asarray(line.y, float)
    counted = record.judging["counted"] > 0.0
    assert np.array_equal(np.isfinite(error), counted)
    assert np.nanmax(abs(error)) == record.scores["states"]["x"]["max_error"]


def test_a_plot_that_cannot_be_is_one_line(record):
    with pytest.raises(InputError, match="plot 'speed': must be position, velocity, errors, innovations or path"):
        record.plot("speed")
    bare = flownav.Record({"kind": "replay"}, {"estimate": dict(record.estimate)})
    with pytest.raises(InputError, match="no truth; plot 'innovations'"):
        bare.plot("errors")


def test_a_record_is_copied_and_pickled(record):
    for again in (copy.deepcopy(record), pickle.loads(pickle.dumps(record))):
        assert again.scores == record.scores
        assert np.array_equal(again.estimate["pos_n_m"], record.estimate["pos_n_m"])
        assert again.estimate.name == "estimate"


# -- what is flown ----------------------------------------------------------------------------------------------------
def test_a_scenario_is_changed_and_read_back(tmp_path):
    scenario = flownav.Scenario.load("landing")
    other = scenario.changed(wind={"speed_20ft_m_s": 5.0}, gps="midg", vehicle="quad-450")
    assert other.changed(wind={"from_direction_deg": 90.0}).file.wind.speed_20ft_m_s == 5.0
    assert scenario.file.wind.speed_20ft_m_s == 0.0
    assert flownav.Scenario.load(other.save(tmp_path / "other.toml")) == other
    assert repr(other) == "<Scenario landing: 50 s, quad-450, midg GPS, landing filter>"
    again = flownav.fly(other, flight={"duration_s": 6.0}, seed=2)
    named = flownav.fly("landing", flight={"duration_s": 6.0}, wind={"speed_20ft_m_s": 5.0}, gps="midg",
                        vehicle="quad-450", seed=2)  # fmt: skip
    assert again.scores == named.scores


def test_a_scenario_that_names_files_is_read_back_from_another_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    flownav.Vehicle.load("quad-450").changed(name="mine").save("mine.toml")
    scenario = flownav.Scenario.load("landing").changed(vehicle="mine.toml")
    (tmp_path / "deep").mkdir()
    kept = flownav.Scenario.load(scenario.save(tmp_path / "deep" / "scenario.toml"))
    assert kept.file.vehicle.file == str(tmp_path / "mine.toml")


def test_a_vehicle_and_a_sensor_made_in_python_fly(tmp_path):
    heavy = flownav.Vehicle.load("quad-450").changed(body={"mass_kg": 1.6})
    assert heavy.entries["body"]["mass_kg"]["uncertainty"] == 0.15
    late = flownav.Sensor.load().changed(dynamics={"b_1_s": 30.0})
    record = flownav.fly("landing", flight={"duration_s": 6.0}, vehicle=heavy, flow_sensor=late)
    assert record.manifest["parameters"]["vehicle"]["body.mass_kg"]["value"] == 1.6
    assert record.manifest["parameters"]["flow_sensor"]["dynamics"]["b_1_s"] == 30.0
    saved = flownav.fly("landing", flight={"duration_s": 6.0}, vehicle=heavy.save(tmp_path / "heavy.toml"),
                        flow_sensor=late.save(tmp_path / "late.toml"))  # fmt: skip
    assert saved.scores == record.scores


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"body": {"mass_kg": -1.0}}, "body.mass_kg"),
        ({"body": {"weight": 1.0}}, "unknown key"),
        ({"name.first": 1}, "name is no table"),
        ({"body": {"mass_kg": 40.0}}, "hover"),
    ],
)
def test_a_vehicle_that_cannot_be_is_one_line(changes, message):
    with pytest.raises(InputError) as caught:
        flownav.Vehicle.load("quad-450").changed(**changes)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_number_of_a_flight_and_its_table_stand_side_by_side():
    third = flownav.fly("landing", flight=3, **{"flight.duration_s": 6.0})
    assert (third.manifest["flight"], third.truth["t_s"][-1]) == (3, 6.0)
    first = flownav.fly("landing", flight={"duration_s": 6.0})
    assert first.manifest["flight"] == 0
