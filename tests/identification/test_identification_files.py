"""From rig logs to files: readers, the sensor file and what it holds, autopilot parameters, schedules."""

from __future__ import annotations

import math
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from flownav.core.errors import InputError
from flownav.core.provenance import hash_of
from flownav.core.text import to_toml
from flownav.lab.identification.autopilot_parameters import left_out, parameters, write_parameters
from flownav.lab.identification.descent import Structure
from flownav.lab.identification.findings import Findings
from flownav.lab.identification.first_look import judge
from flownav.lab.identification.height_law import QualityPoint, compare_schedules, paper_sigma, variance_by_quality
from flownav.lab.identification.job import identify
from flownav.lab.identification.own_gyro import OwnGyro
from flownav.lab.identification.quantities import CANDIDATES, Interval
from flownav.lab.identification.rig_log import rate_of, read_runs
from flownav.lab.identification.sensor_file import bessel, sensor_entries, write_sensor
from flownav.sensors.datasheet import load_sensor
from flownav.sensors.settings import FlowSettings

A, B, C = 210.0, 16.0, 200.0  # gain 1.05, latency 80 ms
COUNTS, ROD_M = 40_000, 1.5


def swing(folder: Path, seed=0, *, height_m=0.6, noise=0.02, encoder=False, tone=False, sheet=True, duration_s=25.0,
          gain=1.0, jitter=0.0):  # fmt: skip
    """A rig folder: the paper's kind of sensor on a swing of several tones, or of one."""
    random = np.random.default_rng(seed)
    t_s = np.arange(0.0, duration_s, 0.01)
    t_s[1:] += jitter * 0.01 * random.uniform(-0.4, 0.4, len(t_s) - 1)
    rates = ((0.5, 3.1),) if tone else ((0.3, 2.0), (0.15, 7.0), (0.1, 17.0), (0.05, 33.0))
    angle = sum(size / ROD_M / rate * np.sin(rate * t_s + seed) for size, rate in rates)
    velocity = sum(size * np.cos(rate * t_s + seed) for size, rate in rates)
    fine = np.arange(0.0, duration_s, 0.001)
    sensed = signal.lsim(([gain * A], [1.0, B, C]), np.interp(fine, t_s, velocity), fine)[1]
    flow = np.interp(t_s, fine, sensed) + noise * random.standard_normal(len(t_s))
    columns = {"t_s": t_s, "flow_velocity_m_s": flow, "quality": np.full(len(t_s), 255.0)}
    columns |= (
        {"encoder_counts": np.round(angle * COUNTS / (2 * np.pi))} if encoder else {"reference_velocity_m_s": velocity}
    )
    return table(folder, columns, height_m if sheet else None)


def table(folder, columns, height_m=None):
    folder.mkdir(parents=True, exist_ok=True)
    rows = np.column_stack(list(columns.values()))
    np.savetxt(folder / "rig.csv", rows, "%.9g", ",", header=",".join(columns), comments="")
    if height_m is not None:
        lines = (f"height_m = {height_m}", f"rod_length_m = {ROD_M}", f"encoder_counts_per_revolution = {COUNTS}")
        (folder / "rig.toml").write_text("schema_version = 1\npad = 'stripes'\n" + "\n".join(lines) + "\n")
    return folder


@pytest.fixture(scope="module")
def found(tmp_path_factory) -> Findings:
    """Two heights, two runs each, with noise that grows."""
    folder = tmp_path_factory.mktemp("rig")
    for number, (height_m, noise) in enumerate(((0.6, 0.02), (0.6, 0.02), (1.2, 0.06), (1.2, 0.06)), start=1):
        swing(folder / f"run-{number:03d}", number, height_m=height_m, noise=noise)
    return identify([folder])


# -- rig logs --------------------------------------------------------------------------------------------------
def test_the_known_sensor_is_recovered_at_each_height(found):
    assert [response.height_m for response in found.responses] == [0.6, 1.2]
    for response in found.responses:
        assert response.model.structure == Structure(2)
        assert response.gain.low <= A / C <= response.gain.high
        assert response.latency_s.low <= B / C <= response.latency_s.high
    assert found.excitation.complete
    assert len(found.run_models) == 4
    assert found.noise.law.exponent.value == pytest.approx(math.log(3.0) / math.log(2.0), abs=0.1)


def test_an_encoder_serves_as_well_as_a_velocity(tmp_path):
    by_encoder = identify([swing(tmp_path / "encoder", encoder=True)], [Structure(2)])
    by_velocity = identify([swing(tmp_path / "velocity")], [Structure(2)])
    assert by_encoder.reference == "encoder"
    assert by_encoder.gain.value == pytest.approx(by_velocity.gain.value, rel=0.01)
    assert by_encoder.latency_s.value == pytest.approx(by_velocity.latency_s.value, abs=0.002)


def test_a_rate_is_exact_for_a_cubic_at_irregular_times():
    t_s = np.sort(np.random.default_rng(0).uniform(0.0, 2.0, 200))
    np.testing.assert_allclose(rate_of(t_s, 1.0 - 2.0 * t_s + t_s**3), -2.0 + 3.0 * t_s**2, atol=1e-6)


def test_irregular_times_are_taken_as_they_are(tmp_path):
    response = identify([swing(tmp_path, jitter=1.0)], [Structure(2)]).responses[0]
    assert response.gain.low - 0.005 <= A / C <= response.gain.high + 0.005


def test_a_csv_alone_is_a_run_and_takes_its_height_from_the_option(tmp_path):
    folder = swing(tmp_path, sheet=False)
    with pytest.raises(InputError, match=r"rig.csv: its height is unknown: give heights_m, height_m in rig.toml"):
        identify([folder / "rig.csv"])
    assert identify([folder / "rig.csv"], [Structure(0)], [0.8]).heights_m == (0.8, 0.8)


def test_rows_without_data_are_left_out(tmp_path):
    folder = swing(tmp_path)
    lines = (folder / "rig.csv").read_text().splitlines()
    blind = [line if i % 10 else ",".join([*line.split(",")[:1], "0", "0", *line.split(",")[3:]])
             for i, line in enumerate(lines[1:])]  # fmt: skip
    (folder / "rig.csv").write_text("\n".join([lines[0], *blind]) + "\n")
    (run,) = read_runs(folder)
    assert run.rejected["no_data"] == 250
    assert identify([folder], [Structure(2)]).gain.value == pytest.approx(A / C, rel=0.01)


@pytest.mark.parametrize(
    ("columns", "height_m", "message"),
    [
        ({"flow_velocity_m_s": 0.1}, 0.6, "rig.csv: no reference; a column reference_velocity_m_s, encoder_counts or"),
        ({"flow_velocity_m_s": 0.1, "encoder_counts": 5.0}, None,
         "rig.csv: encoder_counts need encoder_counts_per_revolution in rig.toml beside it"),
        ({"flow_velocity_m_s": 0.1, "encoder_angle_rad": 0.2}, None, "rig.csv: an encoder needs rod_length_m in rig"),
        ({"reference_velocity_m_s": 0.1}, 0.6, "rig.csv: no column flow_velocity_m_s; a rig.csv needs t_s, flow_vel"),
        ({"flow_velocity_m_s": 0.1, "reference_velocity_m_s": 0.1, "quality": 0.0}, 0.6,
         "rig.csv: quality is 0 (no data) in every row; the sensor saw nothing"),
        ({"flow_velocity_m_s": 300.0, "reference_velocity_m_s": 0.1}, 0.6,
         "rig.csv: flow_velocity_m_s: 100% of the rows lie outside -20 to 20 (one is 300); metres per second"),
    ],
)  # fmt: skip
def test_a_rig_log_that_lacks_something_says_what(tmp_path, columns, height_m, message):
    t_s = np.arange(0.0, 5.0, 0.01)
    folder = table(tmp_path, {"t_s": t_s} | {name: np.full(len(t_s), size) for name, size in columns.items()}, height_m)
    with pytest.raises(InputError) as error:
        identify([folder])
    assert str(error.value).removeprefix(f"{tmp_path}/").startswith(message)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("heights", "message"),
    [
        ([0.6, 0.8], "heights_m: 2 heights for 1 logs"),
        ([-1.0], "heights_m: metres from 0.01"),
    ],
)
def test_heights_that_cannot_be_are_refused(tmp_path, heights, message):
    with pytest.raises(InputError, match=message):
        identify([swing(tmp_path, duration_s=5.0)], heights_m=heights)


def test_a_reference_that_a_rig_has_not_is_refused(tmp_path):
    folder = swing(tmp_path, duration_s=5.0)
    with pytest.raises(InputError, match="a column encoder_counts or encoder_angle_rad is needed"):
        identify([folder], reference="encoder")
    with pytest.raises(InputError, match="reference gps: auto, velocity or encoder are possible for a rig log"):
        identify([folder], reference="gps")


# -- the sensor file ---------------------------------------------------------------------------------------------
def written(found, path):
    return write_sensor(path, sensor_entries(found, load_sensor(), "test", "pytest"))


def test_the_file_holds_what_was_found_and_loads(found, tmp_path):
    sensor = written(found, tmp_path / "sensor.toml")
    assert load_sensor(tmp_path / "sensor.toml") == sensor
    assert sensor.dynamics.gain == pytest.approx(A / C, rel=0.01)
    assert sensor.dynamics.delay_s == pytest.approx(B / C, rel=0.02)
    known = sensor.identification
    assert known.dynamics.validity == "identified"
    assert known.dynamics.c_low_1_s2 < sensor.dynamics.c_1_s2 < known.dynamics.c_high_1_s2
    assert known.dynamics.a_low_1_s2 < sensor.dynamics.a_1_s2 < known.dynamics.a_high_1_s2
    assert [row.height_m for row in known.responses] == [0.6, 1.2]
    assert len(sensor.identified_models) == 4
    assert {Path(source.path).name for source in known.sources} == {"rig.csv", "rig.toml"}
    assert all(source.sha256 == hash_of(Path(source.path)) for source in known.sources)
    assert FlowSettings(identified_height_m=1.2, identified_model=2).parameters(sensor).noise_low_m == 0.6


def test_what_was_not_measured_says_so(found, tmp_path):
    written(found, tmp_path / "sensor.toml")
    entries = tomllib.loads((tmp_path / "sensor.toml").read_text())
    assert entries["optics"]["focal_length_px"]["source"].startswith("not measured here; taken over from PX4FLOW")
    assert entries["dynamics"]["c_1_s2"]["uncertainty"] > 0.0


def test_dynamics_that_a_tone_does_not_show_are_assumed_and_say_so(tmp_path):
    tone = identify([swing(tmp_path / "log", tone=True, noise=0.05)])
    sensor = written(tone, tmp_path / "sensor.toml")
    assert sensor.identification.dynamics.validity == "assumed"
    assert (sensor.dynamics.b_1_s, sensor.dynamics.c_1_s2) == pytest.approx(bessel(tone.latency_s.value))
    assert sensor.dynamics.delay_s == pytest.approx(tone.latency_s.value, rel=1e-5)
    assert sensor.dynamics.gain == pytest.approx(tone.gain.value, rel=1e-5)


def test_an_inverted_sensor_gets_a_positive_model_and_a_verdict(tmp_path):
    inverted = identify([swing(tmp_path / "log", gain=-1.0)])
    sensor = written(inverted, tmp_path / "sensor.toml")
    assert sensor.identification.axes == "sign is inverted"
    assert sensor.identification.gain < 0.0 < sensor.dynamics.a_1_s2


def test_nothing_is_left_where_the_file_cannot_be_written(found, tmp_path):
    (tmp_path / "taken").write_text("a file, not a folder")
    with pytest.raises(InputError, match=r"taken/sensor.toml: cannot be written .*; give another name"):
        written(found, tmp_path / "taken" / "sensor.toml")
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def test_an_older_file_stays_whole_until_the_new_one_is(found, tmp_path):
    path = tmp_path / "sensor.toml"
    path.write_text("old")
    entries = sensor_entries(found, load_sensor(), "test", "pytest")
    entries["limits"]["max_height_m"] = -1.0
    with pytest.raises(InputError, match=r"sensor.toml: limits.max_height_m"):
        write_sensor(path, entries)
    assert path.read_text() == "old"


keys = st.text("abcdefgh_", min_size=1, max_size=8)
scalars = st.one_of(st.integers(-(2**40), 2**40), st.booleans(), st.text(max_size=20), st.floats(-1e6, 1e6).map(
    lambda number: float(f"{number:.7g}")))  # fmt: skip
nested = st.dictionaries(
    keys.filter(lambda key: key != "value"),
    st.one_of(
        scalars,
        st.lists(st.integers(), max_size=3),
        st.dictionaries(keys, scalars, max_size=3).filter(lambda table: "value" not in table),
        st.lists(st.dictionaries(keys, scalars, max_size=3).filter(lambda t: "value" not in t), min_size=1, max_size=3),
    ),
    max_size=5,
)


@given(nested)
def test_toml_reads_back_as_it_was_written(entries):
    assert tomllib.loads(to_toml(entries)) == entries


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_number_of_all_its_digits_reads_back_to_the_bit(number):
    assert tomllib.loads(to_toml({"x": number}))["x"] == number


# -- autopilots ----------------------------------------------------------------------------------------------------
def by_name(autopilot, found):
    return {p.name: p for p in parameters(autopilot, found)}


def test_px4s_parameters_are_the_findings_in_its_units(found):
    p = by_name("px4", found)
    assert p["EKF2_OF_DELAY"].value == pytest.approx(1e3 * found.latency_s.value)
    worst = max(point.sigma_m_s / point.height_m for point in found.noise.points)
    assert p["EKF2_OF_N_MIN"].value == pytest.approx(max(0.05, worst))
    assert p["EKF2_OF_N_MAX"].value >= p["EKF2_OF_N_MIN"].value
    assert all(any(digit in p.reason for digit in "0123456789") for p in p.values())


def test_a_limit_is_the_datasheets_and_never_what_one_flight_reached(found):
    limits = ("SENS_FLOW_MINHGT", "SENS_FLOW_MAXHGT", "SENS_FLOW_MAXR")
    assert not {*limits, "EKF2_OF_QMIN"} & by_name("px4", found).keys()
    why = dict(left_out("px4", found))
    assert {"EKF2_OF_QMIN", *limits} == why.keys()
    assert "datasheet" in why["SENS_FLOW_MAXR"]
    sheet = load_sensor()
    p = by_name("px4", replace(found, max_flow_rad_s=20.0, datasheet=sheet))
    assert [p[name].value for name in limits] == [0.05, 3.5, sheet.limits.max_flow_rad_s]
    assert "SENS_FLOW_MINRNG" in p["SENS_FLOW_MINHGT"].reason
    assert "EKF2_OF_RMAX" in p["SENS_FLOW_MAXR"].reason


def told_gain(found, value, low, high, **changes):
    """The findings with another gain."""
    return replace(found, responses=(replace(found.responses[0], gain=Interval(value, low, high)),), **changes)


@pytest.mark.parametrize(("autopilot", "name", "was", "value"), [
    ("px4", "SENS_FLOW_SCALE", {}, 1.0 / 0.877),
    ("px4", "SENS_FLOW_SCALE", {"SENS_FLOW_SCALE": 1.1}, 1.1 / 0.877),
    ("inav", "opflow_scale", {}, 10.5 * 0.877),
    ("inav", "opflow_scale", {"opflow_scale": 9.0}, 9.0 * 0.877),
    ("ardupilot", "FLOW_FYSCALER", {"FLOW_FYSCALER": 100.0}, 1e3 * (1.1 / 0.877 - 1.0)),
])  # fmt: skip
def test_the_factor_of_each_autopilot_undoes_the_gain_beside_what_was_set(found, autopilot, name, was, value):
    p = by_name(autopilot, told_gain(found, 0.877, 0.873, 0.880, parameters=was))[name]
    assert p.value == pytest.approx(value, rel=1e-12)
    low, high = (float(number) for number in re.findall(r"\[(\S+), (\S+)\]", p.reason)[-1])
    assert low <= round(p.value, 3) <= high
    assert low < high
    assert p.needed is None


def test_a_value_that_its_range_cuts_says_what_was_needed(found):
    p = by_name("ardupilot", told_gain(found, 0.45, 0.449, 0.451))["FLOW_FYSCALER"]
    assert (p.value, round(p.needed)) == (800.0, 1222)
    assert p.reason.endswith("1222 is needed, cut to the parameter's range of -800 to 800")
    p = by_name("px4", told_gain(found, 0.45, 0.449, 0.451))["SENS_FLOW_SCALE"]
    assert (p.value, p.needed) == (1.5, pytest.approx(1.0 / 0.45))


def test_one_factor_is_not_written_for_axes_that_differ(found):
    apart = told_gain(found, 0.9, 0.75, 1.05)
    assert "SENS_FLOW_SCALE" not in by_name("px4", apart)
    assert "one factor does not serve them all" in dict(left_out("px4", apart))["SENS_FLOW_SCALE"]
    assert by_name("px4", told_gain(found, 1.01, 0.97, 1.05))["SENS_FLOW_SCALE"].value == 1.0


@pytest.mark.parametrize("autopilot", ["px4", "ardupilot", "inav"])
def test_no_factor_is_written_where_the_time_is_wrong(found, autopilot):
    half = OwnGyro(Interval(0.498, 0.496, 0.5), 0.02, 0.99, 0.0)
    wrong = told_gain(found, 0.441, 0.439, 0.443, own_gyro=half)
    assert not {"SENS_FLOW_SCALE", "FLOW_FYSCALER", "opflow_scale"} & by_name(autopilot, wrong).keys()
    assert any("integration time wrong by 2 (stated too long)" in why for _, why in left_out(autopilot, wrong))
    own = told_gain(found, 0.95, 0.94, 0.96, own_gyro=half)
    assert {"SENS_FLOW_SCALE", "FLOW_FYSCALER", "opflow_scale"} & by_name(autopilot, own).keys()
    assert "the gyro's own scale is wrong by 0.50" in own.gyro_verdict


def test_a_worse_quality_raises_px4s_greatest_noise(found):
    classes = (QualityPoint(1, 63, 4 * 0.0004, 100), QualityPoint(255, 255, 0.0004, 100))
    graded = replace(found, noise=replace(found.noise, quality=classes))
    p = by_name("px4", graded)
    assert p["EKF2_OF_N_MAX"].value == pytest.approx(2.0 * p["EKF2_OF_N_MIN"].value)


def test_ardupilots_scaler_undoes_the_gain_of_the_other_axis(found):
    """Velocity along x is flow about y; EKF3 takes 50 ms off by itself."""
    p = by_name("ardupilot", found)
    assert p["FLOW_FYSCALER"].value == pytest.approx(1e3 * (1.0 / found.best.gain.value - 1.0))
    assert "FLOW_FXSCALER" not in p  # a rig moves along one axis
    assert p["EK3_FLOW_DELAY"].value == pytest.approx(1e3 * found.latency_s.value - 50.0)
    assert p["EK3_FLOW_I_GATE"].value >= 300.0
    assert p["EK3_FLOW_I_GATE"].value % 25.0 == 0.0


def test_a_gain_that_may_be_one_is_left_alone(found):
    response = found.responses[0]
    same = replace(found, responses=(replace(response, gain=response.gain._replace(value=1.01, low=0.97, high=1.05)),))
    assert by_name("ardupilot", same)["FLOW_FYSCALER"].value == 0.0


def poorly_seen(found, identifiable, unseen=(60.0,)):
    """The findings of a log whose input shows this number of parameters, and whose model has this fit on unseen
    data.
    """
    response = found.responses[0]
    shown = response.choice.excitation._replace(identifiable=identifiable, verdict=f"{identifiable} of 3 shown")
    tried = tuple((fit, shown) for fit, _ in response.choice.tried)
    choice = replace(response.choice, excitation=shown, tried=tried)
    return replace(found, responses=(replace(response, choice=choice, validation_percent=unseen),))


@pytest.mark.parametrize(("autopilot", "delay"), [("px4", "EKF2_OF_DELAY"), ("ardupilot", "EK3_FLOW_DELAY")])
def test_a_latency_that_is_not_identifiable_is_not_written_and_the_file_says_so(found, tmp_path, autopilot, delay):
    assert delay in by_name(autopilot, poorly_seen(found, 2))
    poor = poorly_seen(found, 1)
    assert poor.excitation.identifiable == 1
    assert delay not in by_name(autopilot, poor)
    write_parameters(tmp_path / "file", autopilot, poor, "a sensor")
    text = (tmp_path / "file").read_text()
    assert f"# {delay} is not written: latency: 1 of 3 shown\n" in text
    assert all(line.startswith("#") for line in text.splitlines() if delay in line)
    assert dict(left_out(autopilot, poor))[delay] == "latency: 1 of 3 shown"


@pytest.mark.parametrize(("identifiable", "unseen", "why"), [
    (0, (60.0,), ": 0 of 3 shown"),
    (2, (1.3,), "its model fits 1.3 % of what it was not fitted to, 20 % are needed"),
    (2, (-30.0, 40.0), "its model fits 5.0 % of what it was not fitted to, 20 % are needed"),
])  # fmt: skip
def test_a_gain_that_the_log_does_not_show_is_not_written(found, tmp_path, identifiable, unseen, why):
    poor = poorly_seen(found, identifiable, unseen)
    assert "FLOW_FYSCALER" not in by_name("ardupilot", poor)
    write_parameters(tmp_path / "file", "ardupilot", poor, "a sensor")
    said = [line for line in (tmp_path / "file").read_text().splitlines() if "FLOW_FYSCALER" in line]
    assert len(said) == 1
    assert said[0].startswith("# FLOW_FYSCALER is not written: gain of velocity x ")
    assert said[0].endswith(why)


def test_a_gain_without_unseen_data_is_written_by_its_interval(found):
    for unseen in ((), (math.nan,), (25.0,)):
        assert "FLOW_FYSCALER" in by_name("ardupilot", poorly_seen(found, 2, unseen))
    assert left_out("ardupilot", poorly_seen(found, 3)) == []


def test_a_turned_sensor_is_told_how_to_be_set(found, tmp_path):
    turned = replace(found, kind="flight", axes=judge(np.diag([-0.9, -0.9])))
    write_parameters(tmp_path / "a.param", "ardupilot", turned, "a sensor")
    assert "# set FLOW_ORIENT_YAW to 18000 (180 deg)" in (tmp_path / "a.param").read_text()
    write_parameters(tmp_path / "p.params", "px4", turned, "a sensor")
    assert "# set SENS_FLOW_ROT to 4 (180 deg)" in (tmp_path / "p.params").read_text()


@pytest.mark.parametrize(("autopilot", "fields", "separator"), [("px4", 5, "\t"), ("ardupilot", 2, ",")])
def test_each_value_has_the_figure_that_it_came_from_above_it(found, tmp_path, autopilot, fields, separator):
    write_parameters(tmp_path / "file", autopilot, found, "a sensor")
    lines = (tmp_path / "file").read_text().splitlines()
    values = [i for i, line in enumerate(lines) if not line.startswith("#")]
    assert len(values) >= 3
    for i in values:
        assert len(lines[i].split(separator)) == fields
        assert lines[i - 1].startswith("# ")


def test_another_autopilot_is_refused(found):
    with pytest.raises(InputError, match="autopilot betaflight: px4, ardupilot or inav are possible"):
        parameters("betaflight", found)


# -- schedules -----------------------------------------------------------------------------------------------------
def readings(count=8000, seed=0):
    random = np.random.default_rng(seed)
    return random, 0.5 + 1.5 * random.random(count), np.full(count, 255.0)


def test_a_noise_that_grows_with_height_is_best_told_by_height():
    random, height, quality = readings()
    error = 0.05 * height**2 * random.standard_normal(len(height))
    scores = compare_schedules(error, height, quality, 0.3)
    assert {row.name for row in scores} == {"constant", "quality", "height", "paper"}
    assert scores[0].name == "height"
    assert scores[0].share_within_2_sigma == pytest.approx(0.954, abs=0.015)
    assert scores[0].sigma_lowest_m_s < 0.5 * scores[0].sigma_highest_m_s


def test_a_noise_that_follows_quality_is_best_told_by_quality():
    random, height, quality = readings()
    quality = np.where(random.random(len(height)) < 0.5, 100.0, 255.0)
    error = np.where(quality < 200, 0.2, 0.03) * random.standard_normal(len(height))
    assert compare_schedules(error, height, quality, 0.3)[0].name == "quality"
    low, high = variance_by_quality(error, quality)
    assert low.variance_m2_s2 == pytest.approx(0.04, rel=0.1)
    assert high.variance_m2_s2 == pytest.approx(0.0009, rel=0.1)


def test_a_noise_that_follows_the_papers_rule_is_best_told_by_it_or_a_power_near_it():
    random, height, quality = readings()
    error = paper_sigma(height + 0.2, 0.4) * random.standard_normal(len(height))
    names = [row.name for row in compare_schedules(error, height + 0.2, quality, 0.4)]
    assert set(names[:2]) == {"paper", "height"}


@given(st.integers(8, 300), st.integers(0, 50))
def test_schedules_are_scored_for_any_errors(count, seed):
    random = np.random.default_rng(seed)
    scores = compare_schedules(
        random.standard_normal(count), random.uniform(0.1, 5.0, count), random.integers(0, 256, count) * 1.0, 0.3
    )
    assert all(np.isfinite(row.score) for row in scores)


def test_the_default_candidates_hold_every_order_that_the_issue_names():
    assert {structure.order for structure in CANDIDATES} == {0, 1, 2, 3}
