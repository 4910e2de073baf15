"""Many cameras, each on a flight: what is drawn repeats, statistics find what was put in, the datasheet says it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from flownav.cli import pad as pad_command
from flownav.core.errors import InputError
from flownav.lab.optics.camera import field_angle_rad
from flownav.lab.optics.pad import PadTarget
from flownav.lab.optics.pad_datasheet import Assumed, datasheet
from flownav.lab.optics.pad_fix import truth_of
from flownav.lab.optics.pad_statistics import (
    NoiseLaw,
    beta_of,
    biases_and_laws,
    columns_of,
    fitted_noise,
    heights_in_range,
    laws_of,
    missed_law,
    sigma_of,
)
from flownav.lab.optics.pad_trial import CAMERAS, TrialFrame, camera_flight, camera_named, frames_at, tried
from flownav.sensors.camera_sheets import PadCameraSheet

TAG = PadTarget()
RNG = np.random.default_rng(5)


def made(flights: int = 24, cases: int = 60, hidden: float = 0.0) -> list[TrialFrame]:
    """Frames by laws that are known: 3 mrad and 0.5 % of bias, noise (0.3, 0.1 h, 1.0 w) mrad, (0.2, 0.3 h, 0) %."""
    rng = np.random.default_rng(3)
    frames = []
    for flight in range(flights):
        bias, scale = 3e-3 * rng.standard_normal(2), 5e-3 * rng.standard_normal()
        blind = flight < hidden * flights
        for _ in range(cases):
            height = float(rng.choice([0.2, 0.5, 1.0, 2.0, 4.0]))
            speed = float(rng.choice([0.1, 1.0]))
            rate = float(speed / height * rng.uniform(0.8, 1.2))
            ray = rng.uniform(-0.6, 0.6, 2)
            across = sigma_of(NoiseLaw(3e-4, 1e-4, 1e-3, 0.0), np.array(height), np.array(rate))
            noise = across * rng.standard_normal(2)
            far = sigma_of(NoiseLaw(2e-3, 3e-3, 0.0, 0.0), np.array(height), np.array(rate)) * rng.standard_normal()
            error = np.array([*(bias - scale * ray / (1.0 + ray @ ray) + noise), scale + far, 0.0])
            found = bool(rng.standard_normal() < 2.0 - 1.5 * height / 4.0 - 0.2 * rate) and not blind
            said = "found" if found else "too far"
            frames.append(
                TrialFrame(flight, height, height, speed, rate, True, found, False, said, (ray[0], ray[1]),
                           error if found else np.full(4, np.nan))
            )  # fmt: skip
    return frames


# -- what is drawn -------------------------------------------------------------------------------------------
def test_a_flight_repeats_and_another_has_another_camera() -> None:
    trial = camera_named("px4flow")
    one, again, other = (camera_flight(trial, PadTarget(0.03), 1, k) for k in (3, 3, 4))
    assert one.taken_for == again.taken_for != other.taken_for
    first, second = (next(frames_at(c, 0.6, 0.2, 1, 1)) for c in (one, again))
    np.testing.assert_array_equal(first[0], second[0])
    assert first[1] == second[1]
    assert one.taken_for != one.optic.lens


def test_the_wide_cameras_are_as_wide_as_they_are_called() -> None:
    for name, half_deg in (("wide120", 60.0), ("wide60", 30.0)):
        trial = CAMERAS[name]
        lens = camera_flight(trial, TAG, 1, 0).optic.lens._replace(focal_px=trial.camera.nominal_focal_px)
        assert np.degrees(field_angle_rad(lens, 320.0)) == pytest.approx(half_deg)


def test_frames_of_the_wide_camera_are_found_and_errors_are_its_calibrations() -> None:
    flown = camera_flight(camera_named("wide120"), TAG, 1, 2)
    frames = list(tried(flown, 2, 0.5, 0.1, 3, 1, 0.2))
    assert sum(f.found for f in frames) >= 2
    for f in frames:
        assert not f.wrong
        if f.found:
            assert 1e-5 < np.hypot(*f.error[:2]) < 0.02
            assert abs(f.error[2]) < 0.03


def test_a_pose_is_drawn_with_the_pads_centre_near_the_frames_middle() -> None:
    flown = camera_flight(camera_named("wide120"), TAG, 1, 0)
    for _, pose, motion in frames_at(flown, 1.0, 0.5, 3, 1):
        truth = truth_of(pose, TAG)
        assert max(abs(truth.tan_forward), abs(truth.tan_right)) < 0.65
        assert np.hypot(motion.velocity_x_m_s, motion.velocity_y_m_s) == pytest.approx(0.5)


# -- what statistics make of it ------------------------------------------------------------------------------
def test_bias_and_noise_are_told_apart() -> None:
    laws, cells = laws_of(made())
    assert laws.bias_rad == pytest.approx(3e-3, rel=0.3)
    assert laws.scale == pytest.approx(5e-3, rel=0.3)
    heights, rates = np.array([0.2, 0.5, 2.0, 4.0]), np.array([0.5, 2.0, 0.05, 0.05])
    wanted = sigma_of(NoiseLaw(3e-4, 1e-4, 1e-3, 0.0), heights, rates)
    np.testing.assert_allclose(sigma_of(laws.angle, heights, rates), wanted, rtol=0.15)
    far = sigma_of(NoiseLaw(2e-3, 3e-3, 0.0, 0.0), heights, rates)
    np.testing.assert_allclose(sigma_of(laws.distance, heights, rates), far, rtol=0.2)
    assert laws.angle.spread < 0.1
    assert {(c.height_m, c.speed_m_s) for c in cells} == {(h, s) for h in (0.2, 0.5, 1.0, 2.0, 4.0) for s in (0.1, 1.0)}
    assert sum(c.frames for c in cells) == laws.frames == 24 * 60
    assert laws.flights == 24
    assert laws.false_share == pytest.approx(1.0 / (24 * 60 + 2))


def test_the_biases_are_each_flights_own() -> None:
    rng = np.random.default_rng(3)
    biases, *_ = biases_and_laws(columns_of(made()))
    forward, right = 3e-3 * rng.standard_normal(2)
    assert biases[0].forward_rad == pytest.approx(forward, abs=4e-4)
    assert biases[0].right_rad == pytest.approx(right, abs=4e-4)


def test_a_flight_that_is_noisier_shows_in_the_spread() -> None:
    rng = np.random.default_rng(8)
    flights = np.repeat(np.arange(40), 50)
    left = 1e-3 * np.exp(0.3 * rng.standard_normal(40))[flights, None] * rng.standard_normal((2000, 2))
    law = fitted_noise(left, rng.uniform(0.2, 3.0, 2000), rng.uniform(0.1, 3.0, 2000), flights)
    assert law.spread == pytest.approx(0.3, rel=0.3)
    assert fitted_noise(left / np.exp(0.0), np.ones(2000), np.ones(2000), flights * 0).spread == 0.0


def test_missed_shares_are_found_again() -> None:
    law = missed_law(columns_of(made(60, 120)), 4.0)
    assert law.share == pytest.approx(0.023, abs=0.02)
    assert law.share_at_max_height == pytest.approx(0.31, abs=0.08)
    assert law.share_at_blur > law.share


def test_pads_that_are_hidden_for_a_whole_flight_are_told_apart_from_missed_frames() -> None:
    law = missed_law(columns_of(made(60, 120, hidden=0.1)), 4.0)
    a, b = law.hidden
    assert a / (a + b) == pytest.approx(0.11, abs=0.05)
    assert a < 1.0  # nearly all or nearly none
    assert law.share < 0.06
    even = beta_of(np.full(20, 0.2), np.full(20, 50))
    assert even[0] / sum(even) == pytest.approx(0.2, abs=0.01)
    assert even[0] > 5.0


def test_heights_at_which_most_are_missed_are_out_of_range() -> None:
    frames = [f._replace(found=f.found and 0.3 < f.height_m < 3.0) for f in made()]
    assert heights_in_range(columns_of(frames)) == (0.5, pytest.approx(2.0, rel=0.1))
    with pytest.raises(InputError, match="no height"):
        heights_in_range(columns_of([f._replace(found=False) for f in frames]))
    with pytest.raises(InputError, match=r"too few|no height"):
        laws_of([f for f in made(3, 6) if f.height_m < 3.0])


# -- the datasheet and the command ---------------------------------------------------------------------------
def test_the_datasheet_says_what_was_measured(tmp_path: Path) -> None:
    laws, _ = laws_of(made())
    text = datasheet(
        laws, CAMERAS["wide120"], "wide120", PadTarget(1.0, "nested"),
        Assumed(rate_hz=10.0, latency_s=0.08, jitter_s=0.02, lens_m=(0.12, 0.0, 0.14), mounting_deg=0.4), "flownav pad",
    )  # fmt: skip
    (tmp_path / "pad.toml").write_text(text, encoding="utf-8")
    sheet = PadCameraSheet.read(tmp_path / "pad.toml")
    p = sheet.parameters()
    assert p.angle_floor_rad == pytest.approx(laws.angle.floor, rel=1e-3)
    assert p.distance_per_m == pytest.approx(laws.distance.per_m, rel=1e-3)
    assert p.boresight_rad == pytest.approx(np.hypot(np.radians(0.4), laws.bias_rad), rel=1e-3)
    assert p.scale == pytest.approx(laws.scale, rel=1e-3)
    assert (p.min_height_m, p.max_height_m) == pytest.approx((laws.min_height_m, laws.max_height_m), rel=1e-3)
    assert p.half_view_forward_tangent == pytest.approx(np.tan(np.radians(60.0)), rel=1e-3)
    assert p.half_view_right_tangent == pytest.approx(0.987, abs=0.01)
    assert sheet.side_m == pytest.approx(0.25)
    assert sheet.ratio == pytest.approx(5.0)
    assert sheet.camera == "wide120"


def test_the_command_measures_prints_and_writes_a_datasheet(tmp_path: Path) -> None:
    app = typer.Typer()
    app.command()(pad_command.command)
    arguments = ["--camera", "px4flow", "--focus", "4", "--heights", "4,5", "--speeds", "0.05", "--flights", "4",
                 "--frames", "8", "--tilt-deg", "1", "--out", str(tmp_path / "pad.toml"),
                 "--pictures", str(tmp_path / "seen")]  # fmt: skip
    result = CliRunner().invoke(app, [*arguments, "--json"], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    facts = json.loads(result.stdout)
    assert [c["height_m"] for c in facts["cells"]] == [4.0, 5.0]
    assert sum(c["found"] for c in facts["cells"]) > 10
    assert facts["laws"]["frames"] == 64
    assert len(list((tmp_path / "seen").glob("*.png"))) == 8
    sheet = PadCameraSheet.read(tmp_path / "pad.toml")
    assert sheet.min_height_m == facts["laws"]["min_height_m"] == 4.0
    printed = CliRunner().invoke(app, arguments, catch_exceptions=False).stdout
    assert "4 cameras px4flow, 64 frames" in printed
    assert "bias that lasts a flight" in printed


@pytest.mark.slow
def test_the_outer_tag_is_seen_as_the_inner_one_is_at_a_fifth_of_the_height() -> None:
    """The datasheet's assumption on a nested tag: angles, and distances as parts of themselves."""
    shares, errors = [], []
    for target, height_m in ((PadTarget(0.2), 1.6), (PadTarget(1.0, "nested"), 8.0)):
        frames = []
        for flight in range(6):
            flown = camera_flight(camera_named("wide120"), target, 1, flight)
            frames += list(tried(flown, flight, height_m, 0.1 * height_m, 4, 1, 0.2))
        shares.append(np.mean([f.found for f in frames]))
        errors.append(np.sqrt(np.nanmean(np.array([f.error for f in frames]) ** 2, axis=0)))
    assert shares[1] == pytest.approx(shares[0], abs=0.2)
    assert errors[1][0] == pytest.approx(errors[0][0], rel=0.6)
    assert errors[1][2] == pytest.approx(errors[0][2], rel=0.8)
