"""The whole experiment: what the instruments send, the logs, the folder, and the paper's fall of fit with height."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from flownav.cli import rig as rig_command
from flownav.core.errors import InputError
from flownav.lab.optics.firmware import VERSIONS
from flownav.lab.rig.experiment import COLUMNS, RigLog, RigSettings, run_campaign, run_experiment
from flownav.lab.rig.instruments import gyro_at, messages, sonar_at

SHORT = RigSettings(duration_s=6.0)
OLD = VERSIONS["2013-09"]
T = np.arange(0.0, 20.0, 0.5e-3)


# -- instruments --------------------------------------------------------------------------------------------
def test_the_sonar_reads_every_tenth_of_a_second_in_millimetres_and_never_below_its_floor() -> None:
    frames = np.arange(0.2, 19.0, 0.004)
    raw, _ = sonar_at(frames, T, np.full_like(T, 0.6), OLD, np.random.default_rng(1))
    changes = np.flatnonzero(np.diff(raw)) * 0.004
    assert np.diff(changes).min() >= 0.096
    np.testing.assert_allclose(raw * 1000.0, np.round(raw * 1000.0), atol=1e-9)
    low, low_smooth = sonar_at(frames, T, np.full_like(T, 0.1), OLD, np.random.default_rng(1))
    assert (low == 0.30).all()
    np.testing.assert_allclose(low_smooth, 0.30)


def test_the_sonars_filter_follows_a_climb_without_lag_in_rate() -> None:
    frames = np.arange(0.2, 19.0, 0.004)
    raw, smooth = sonar_at(frames, T, 0.5 + 0.1 * T, OLD, np.random.default_rng(1))
    assert np.abs(smooth - raw)[2000:].max() < 0.02
    _, median = sonar_at(frames, T, 0.5 + 0.1 * T, OLD._replace(sonar_median=True), np.random.default_rng(1))
    assert (smooth - median)[2000:].mean() == pytest.approx(0.01, abs=0.003)  # one reading behind


def test_the_gyro_has_its_bandwidth_and_noise() -> None:
    frames = np.arange(1.0, 19.0, 0.004)
    fast = np.sin(2.0 * np.pi * 30.0 * T)
    read = gyro_at(frames, T, fast, np.random.default_rng(1))
    assert read.std() == pytest.approx(fast.std() * np.sqrt(0.5), rel=0.08)
    assert gyro_at(frames, T, 0.0 * T, np.random.default_rng(1)).std() == pytest.approx(0.005, rel=0.1)


def sent(quality: list[int], firmware, flow: list[float] | None = None):  # type: ignore[no-untyped-def]
    n = len(quality)
    pixels = np.column_stack([flow or [-1.0] * n, np.zeros(n)])
    still, range_m = np.zeros((n, 3)), np.full(n, 0.8)
    times = 0.002 + 0.004 * np.arange(n + 1)
    return messages(times, pixels, np.array(quality), still, (range_m, range_m), 666.67, firmware, 0.07)


def test_what_is_late_is_read_of_an_earlier_time() -> None:
    frames = np.arange(1.0, 9.0, 0.02)
    ramp = 0.05 * T
    now, before = (gyro_at(frames, T, ramp, np.random.default_rng(1), late_s) for late_s in (0.0, 0.1))
    assert np.median(now - before) == pytest.approx(0.005, abs=2e-4)
    after = gyro_at(frames, T, ramp, np.random.default_rng(1), -0.1)
    assert np.median(after - now) == pytest.approx(0.005, abs=2e-4)
    climb = 0.5 + 0.1 * T
    raw, older = (sonar_at(frames, T, climb, OLD, np.random.default_rng(1), late_s)[0] for late_s in (0.0, 0.3))
    assert np.median(raw - older) == pytest.approx(0.03, abs=1e-3)


def test_a_message_is_the_mean_of_the_valid_frames_since_the_last() -> None:
    speed = 1.0 / 666.67 / 0.004 * 0.8
    log = sent([200, 200, 0, 200, 0, 0], OLD, [-1.0, -2.0, -9.0, -1.0, -9.0, -9.0])
    np.testing.assert_allclose(log.velocity_m_s[:, 0], [1.5 * speed, speed, 0.0])
    assert log.flow_dpx[:, 0].tolist() == [-30, -10, 0]
    assert log.quality.tolist() == [200, 200, 0]


def test_messages_arrive_after_the_transmission_and_the_chain() -> None:
    log = sent([200] * 4, OLD)
    np.testing.assert_allclose(log.arrival_s, np.array([0.010, 0.018]) + 0.003 + 0.07)
    assert len(sent([200] * 100, VERSIONS["2014-10"]).arrival_s) == 10
    assert sent([200] * 4, VERSIONS["2014-08"]).arrival_s[0] > 0.42


def test_the_low_pass_rises_with_its_weight_and_decays_where_there_is_no_quality() -> None:
    speed = 1.0 / 666.67 / 0.004 * 0.8
    log = sent([200] * 4 + [0] * 4, OLD._replace(low_pass=True, frames_per_message=1))
    up = 1.0 - 0.7 ** np.arange(1, 5)
    expected = speed * np.concatenate([up, up[-1] * 0.7 ** np.arange(1, 5)])
    np.testing.assert_allclose(log.velocity_m_s[:, 0], expected)


# -- one run ---------------------------------------------------------------------------------------------------
def gain_delay_fit(log: RigLog) -> tuple[float, float, float]:
    """Gain, delay [s] and fit % of y = gain u(t - delay), the two numbers that a swing identifies."""
    later = log.time_s > 1.0
    y = log.flow_velocity_m_s[later]
    best = (-np.inf, 0.0, 0.0)
    for delay in np.arange(0.0, 0.4, 0.005):
        u = np.interp(log.time_s[later] - delay, log.time_s, log.reference_velocity_m_s)
        gain = float(u @ y / (u @ u))
        fit = 100.0 * (1.0 - np.linalg.norm(y - gain * u) / np.linalg.norm(y - y.mean()))
        best = max(best, (fit, gain, float(delay)))
    return best[1], best[2], best[0]


def test_one_configuration_gives_the_papers_fits_at_all_four_heights() -> None:
    fits = [gain_delay_fit(log)[2] for log in run_campaign(RigSettings(seed=5))]
    np.testing.assert_allclose(fits, [87.0, 78.0, 72.0, 57.0], atol=6.0)
    assert (np.diff(fits) < 0.0).all()


def test_the_sensor_lags_by_the_chain_and_its_own_few_milliseconds() -> None:
    _, delay, _ = gain_delay_fit(run_experiment(replace(SHORT, pad="checker", light="intense")))
    assert delay == pytest.approx(0.07 + 0.012, abs=0.008)
    _, longer, _ = gain_delay_fit(run_experiment(replace(SHORT, pad="checker", light="intense", chain_delay_s=0.2)))
    assert longer - delay == pytest.approx(0.13, abs=0.006)


def test_repairing_the_gyro_scale_takes_the_extra_gain_away() -> None:
    """Section 4.2: 12.8 % under-compensation adds .128 z/l; at 1 m with a rod of 1.1 m that is 11.6 %."""
    settings = replace(SHORT, height_m=1.0, pad="checker", start_angle_rad=0.15, duration_s=10.0)
    old, _, _ = gain_delay_fit(run_experiment(replace(settings, firmware="2014-01")))
    right, _, _ = gain_delay_fit(run_experiment(replace(settings, firmware="2014-01,-gyro-scale")))
    assert old - right == pytest.approx(0.128 * 1.0 / 1.1, abs=0.035)


def test_a_seven_millimetre_pitch_is_lost_from_one_metre_up() -> None:
    fine, coarse = (run_experiment(replace(SHORT, height_m=1.0, pad=pad)) for pad in ("stripes-3.5", "stripes"))
    assert gain_delay_fit(fine)[2] < 20.0
    assert gain_delay_fit(coarse)[2] > 65.0


def test_the_half_pixel_defect_spoils_a_camera_mounted_across() -> None:
    across = replace(SHORT, along="y", pad="texture", height_m=0.8)
    spoilt = gain_delay_fit(run_experiment(across))[2]
    repaired = gain_delay_fit(run_experiment(replace(across, firmware="2013-09,-half-pixel-y")))[2]
    assert repaired > spoilt + 20.0


@pytest.mark.parametrize("light", ["low", "intense"])
def test_the_sensor_works_in_low_and_in_intense_light(light: str) -> None:
    assert gain_delay_fit(run_experiment(replace(SHORT, light=light)))[2] > 78.0


def test_a_run_is_the_same_for_its_seed_and_number_and_differs_from_the_next() -> None:
    tiny = RigSettings(duration_s=3.0)
    first, again = run_experiment(tiny, 2), run_experiment(tiny, 2)
    assert (first.flow_velocity_m_s == again.flow_velocity_m_s).all()
    for other in (run_experiment(tiny, 3), run_experiment(replace(tiny, seed=2), 2)):
        assert (first.encoder_counts != other.encoder_counts).any()


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"height_m": 3.0}, "pivot height"),
        ({"height_m": float("nan")}, "height"),
        ({"duration_s": 0.0}, "duration"),
        ({"excitation": "wobble"}, "excitation"),
        ({"light": "dusk"}, "light"),
        ({"firmware": "2012"}, "firmware"),
        ({"pad": "grass"}, "pad"),
        ({"along": "z"}, "along"),
        ({"runs": 0}, "runs"),
    ],
)
def test_an_experiment_that_cannot_be_set_up_is_refused(changes: dict[str, object], word: str) -> None:
    with pytest.raises(InputError, match=word):
        run_experiment(replace(SHORT, **changes))  # type: ignore[arg-type]


# -- the folder and the command -----------------------------------------------------------------------------------
def run(*arguments: object) -> dict[str, list[dict[str, float]]]:
    app = typer.Typer()
    app.command()(rig_command.command)
    result = CliRunner().invoke(app, [*map(str, arguments), "--json"], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def test_the_command_writes_the_folder_that_identification_reads(tmp_path: Path) -> None:
    facts = run("--out", tmp_path / "one", "--height", 0.6, "--duration", 3.0, "--seed", 4)
    table = np.genfromtxt(tmp_path / "one" / "rig.csv", delimiter=",", names=True)
    assert table.dtype.names == tuple(COLUMNS)
    log = run_experiment(RigSettings(duration_s=3.0, seed=4))
    np.testing.assert_allclose(table["t_s"], log.time_s)
    np.testing.assert_allclose(table["flow_velocity_m_s"], log.flow_velocity_m_s, atol=1e-6)
    np.testing.assert_array_equal(table["encoder_counts"], log.encoder_counts)
    set_up = tomllib.loads((tmp_path / "one" / "rig.toml").read_text())
    assert set_up["schema_version"] == 1
    assert (set_up["pivot_height_m"], set_up["rod_length_m"], set_up["height_m"]) == (2.1, 1.5, 0.6)
    assert set_up["encoder_counts_per_revolution"] == 40_000
    assert (set_up["pad"], set_up["firmware"], set_up["excitation"]) == ("stripes", "2013-09", "swing")
    assert (set_up["seed"], set_up["chain_delay_s"]) == (4, 0.07)
    assert set_up["provenance"]["light"] == "normal"
    assert facts["runs"][0]["rows"] == len(table)
    assert not list((tmp_path / "one").glob(".*"))


def test_several_heights_and_runs_get_a_folder_each(tmp_path: Path) -> None:
    run("--out", tmp_path, "--height", 0.6, "--height", 1.0, "--runs", 2, "--duration", 3.0)
    made = [tomllib.loads((tmp_path / f"run-{k:03d}" / "rig.toml").read_text()) for k in range(1, 5)]
    assert [(m["height_m"], m["provenance"]["run"]) for m in made] == [(0.6, 1), (0.6, 2), (1.0, 1), (1.0, 2)]


def test_the_reference_is_equation_14_of_the_encoder(tmp_path: Path) -> None:
    run("--out", tmp_path, "--duration", 5.0)
    table = np.genfromtxt(tmp_path / "rig.csv", delimiter=",", names=True)
    angle = (table["encoder_counts"] + 0.5) * 2.0 * np.pi / 40_000
    expected = 1.5 * np.cos(angle) * np.gradient(angle, table["t_s"])
    assert (table["reference_velocity_m_s"] - expected)[10:-10].std() < 0.02  # a difference of counts is coarse
    assert np.corrcoef(table["reference_velocity_m_s"], expected)[0, 1] > 0.995


def test_bad_options_write_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="pivot height"):
        run("--out", tmp_path / "x", "--height", 0.6, "--height", 4.0, "--duration", 3.0)
    with pytest.raises(InputError, match="pad"):
        run("--out", tmp_path / "x", "--pad", "grass")
    assert not (tmp_path / "x").exists()
