"""From film to velocity: signs, scale and gyro compensation against the motion field; files; the command."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from itertools import repeat
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from flownav.cli import identify as flow_command
from flownav.core.errors import InputError
from flownav.lab.optics import frame_files
from flownav.lab.optics.camera import Camera, effective_focal_px
from flownav.lab.optics.firmware import VERSIONS, firmware_named
from flownav.lab.optics.flow import compensated, flow_of_frames
from flownav.lab.optics.frame_files import binned, middle, read_frames
from flownav.lab.optics.pad import texture
from flownav.lab.optics.projection import pose_looking_down
from flownav.lab.optics.render import film
from fuzzing import peak_bytes
from optical_oracles import CameraMotion, motion_field

FPS = 250.0
HEIGHT_M = 0.8
CAMERA = Camera(focus_m=HEIGHT_M)
SAME_FOCAL = {"focal_px": effective_focal_px(CAMERA)}


def filmed(vx: float = 0.0, vy: float = 0.0, wx: float = 0.0, wy: float = 0.0, n: int = 60) -> np.ndarray:
    """A camera at constant speed and rate (about y, then x) that looks straight down halfway."""
    t = (np.arange(n) - 0.5 * (n - 1)) / FPS
    poses = [pose_looking_down(vx * s, vy * s, HEIGHT_M, roll_rad=wx * s, pitch_rad=wy * s) for s in t]
    return film(texture(5), poses, camera=CAMERA, seed=3)


# the slowest speeds give flows near a half pixel, where every patch agrees; a whole swing of flow averages out
@pytest.mark.parametrize(("vx", "vy"), [(0.3, 0.0), (-0.3, 0.0), (0.0, 0.42), (0.6, -0.3)])
def test_velocity_has_the_sign_and_the_size_of_the_motion(vx: float, vy: float) -> None:
    series = flow_of_frames(filmed(vx, vy), FPS, range_m=HEIGHT_M, firmware="2014-12", **SAME_FOCAL)
    expected = motion_field(CameraMotion(vx, vy, 0.0, 0.0, 0.0, 0.0), HEIGHT_M, 0.0, 0.0, effective_focal_px(CAMERA))
    np.testing.assert_allclose(series.flow_px.mean(axis=0), np.array(expected) / FPS, atol=0.25)
    np.testing.assert_allclose(series.velocity_m_s.mean(axis=0), [vx, vy], atol=0.25 * HEIGHT_M * FPS / 666.0)
    assert np.sign(series.velocity_m_s.mean(axis=0) * [vx, vy]).min() >= 0
    np.testing.assert_allclose(series.flow_rad_s, -series.velocity_m_s / HEIGHT_M, atol=1e-12)


@pytest.mark.parametrize(("wx", "wy"), [(0.0, 0.4), (0.0, -0.4), (0.4, 0.0), (-0.4, 0.0)])
def test_a_turning_camera_sees_flow_and_the_gyro_takes_it_out(wx: float, wy: float) -> None:
    frames = filmed(wx=wx, wy=wy)
    turning = np.tile([wx, wy, 0.0], (len(frames), 1))
    plain = flow_of_frames(frames, FPS, **SAME_FOCAL)
    corrected = flow_of_frames(frames, FPS, rates_rad_s=turning, **SAME_FOCAL)
    axis = 0 if wy else 1
    expected = (-wy if axis == 0 else wx) * effective_focal_px(CAMERA) / FPS
    assert abs(expected) > 1.0
    assert plain.flow_px[:, axis].mean() == pytest.approx(expected, abs=0.25)
    assert abs(corrected.flow_px[:, axis].mean()) < 0.25
    wrong = flow_of_frames(frames, FPS, rates_rad_s=-turning, **SAME_FOCAL)
    assert abs(wrong.flow_px[:, axis].mean()) > 1.5


def test_compensation_has_the_firmwares_threshold_clamp_and_defects() -> None:
    flow = np.array([[0.5, 0.0], [0.5, 0.0], [4.0, 0.0]])
    rates = np.array([[0.0, 0.009, 0.0], [0.0, -0.3, 0.0], [0.0, 1.0, 0.0]])
    modern, old = VERSIONS["2014-12"]._replace(gyro_compensation=True), VERSIONS["2013-09"]
    turned = np.array([0.0, -0.3, 1.0]) * 0.004 * 666.67
    np.testing.assert_allclose(
        compensated(flow, rates, 0.004, 666.67, modern)[:, 0], [0.5, 0.5 + turned[1], 4.5], rtol=1e-12
    )
    np.testing.assert_allclose(
        compensated(flow, rates, 0.004, 666.67, old)[:, 0],
        [0.5, 0.0, 4.0 + turned[2] * VERSIONS["2013-09"].gyro_scale],  # "do not correct over zero", no clamp
        rtol=1e-12,
    )
    assert (compensated(flow, rates, 0.004, 666.67, VERSIONS["2014-12"]) == flow).all()
    assert firmware_named("2013-09,-gyro-scale").gyro_scale == 1.0


@pytest.mark.parametrize(
    ("given_rates", "given_range", "word"),
    [
        (np.zeros((3, 3)), None, "rates_rad_s"),
        (np.zeros((2, 2)), None, "rates_rad_s"),
        (np.full((2, 3), np.nan), None, "rates_rad_s"),
        (None, [1.0, 2.0, 3.0], "range_m"),
        (None, np.nan, "range_m"),
    ],
)
def test_rates_and_ranges_of_the_wrong_length_are_refused(  # type: ignore[no-untyped-def]
    given_rates, given_range, word: str
) -> None:
    with pytest.raises(InputError, match=word):
        flow_of_frames(np.zeros((2, 64, 64), np.uint8), FPS, rates_rad_s=given_rates, range_m=given_range)


@pytest.mark.parametrize("fps", [0.0, -1.0, float("nan")])
def test_a_frame_rate_must_be_positive(fps: float) -> None:
    with pytest.raises(InputError, match="fps"):
        flow_of_frames(np.zeros((2, 64, 64), np.uint8), fps)


# -- files and the command ------------------------------------------------------------------------------------------
@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    image = pytest.importorskip("PIL.Image")
    for k, frame in enumerate(filmed(0.3, n=8)):
        image.fromarray(frame).save(tmp_path / f"frame-{k:03d}.png")
    return tmp_path


def test_pictures_are_read_back_in_the_order_of_their_names(pictures: Path) -> None:
    assert (read_frames([pictures]) == filmed(0.3, n=8)).all()
    assert (read_frames(sorted(pictures.glob("*.png"))) == filmed(0.3, n=8)).all()


def test_numbered_pictures_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    for number in (1, 2, 10, 11):
        image.fromarray(np.full((5, 6), number, np.uint8)).save(tmp_path / f"test{number}.png")
    assert read_frames([tmp_path])[:, 0, 0].tolist() == [1, 2, 10, 11]


def test_colour_and_sixteen_bit_pictures_become_grey(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    image.fromarray(np.full((5, 6, 3), 90, np.uint8)).save(tmp_path / "a.png")
    image.fromarray(np.full((5, 6), 90 * 256, np.uint16)).save(tmp_path / "b.png")
    assert (read_frames([tmp_path]) == 90).all()


def test_files_that_cannot_be_frames_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    image = pytest.importorskip("PIL.Image")
    with pytest.raises(InputError, match="no pictures"):
        read_frames([tmp_path])
    with pytest.raises(InputError, match="no such file"):
        read_frames([tmp_path / "absent.png"])
    (tmp_path / "broken.png").write_bytes(b"not a picture")
    with pytest.raises(InputError, match=r"broken\.png"):
        read_frames([tmp_path])
    (tmp_path / "broken.png").unlink()
    image.fromarray(np.zeros((5, 6), np.uint8)).save(tmp_path / "a.png")
    image.fromarray(np.zeros((6, 6), np.uint8)).save(tmp_path / "b.png")
    with pytest.raises(InputError, match="one size"):
        read_frames([tmp_path])
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(InputError, match=r"needs PyAV: pip install 'flownav\[video\]'"):
        read_frames([tmp_path / "flight.mp4"])
    monkeypatch.setitem(sys.modules, "PIL", None)
    with pytest.raises(InputError, match=r"pictures need Pillow: pip install 'flownav\[pictures\]'"):
        read_frames([tmp_path])


def test_a_small_file_of_a_huge_picture_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    image.new("1", (8000, 6000)).save(tmp_path / "a.png", compress_level=9)
    assert (tmp_path / "a.png").stat().st_size < 100_000
    before = peak_bytes(anew=True)
    with pytest.raises(InputError, match=r"a.png: 8000x6000 pixels; at most 32,000,000 are read"):
        read_frames([tmp_path])
    assert peak_bytes() - before < 30 << 20
    image.new("1", (100, 60)).save(tmp_path / "a.png")
    assert read_frames([tmp_path]).shape == (1, 60, 100)


def test_a_small_film_of_frames_without_end_is_refused_while_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Frame(NamedTuple):
        width: int = 300
        height: int = 200

        def to_ndarray(self, format: str) -> np.ndarray:
            return np.zeros((self.height, self.width), np.uint8)

    class Film:
        def __enter__(self) -> Film:
            return self

        def __exit__(self, *error: object) -> None:
            pass

        def decode(self, video: int) -> Iterator[Frame]:
            return map(self.counted, repeat(Frame())) if self.endless else iter([Frame()] * 3)

        def counted(self, frame: Frame) -> Frame:
            self.decoded += 1
            return frame

        endless, decoded = True, 0

    made = Film()
    monkeypatch.setitem(sys.modules, "av", SimpleNamespace(open=lambda name: made))
    monkeypatch.setattr(frame_files, "LARGEST_FRAMES_BYTES", 50 * 300 * 200)
    with pytest.raises(InputError, match=r"x.mp4: its frames do not fit in memory; cut it into pieces"):
        read_frames([tmp_path / "x.mp4"])
    assert made.decoded == 51
    made.endless = False
    assert read_frames([tmp_path / "x.mp4"]).shape == (3, 200, 300)


def test_frames_can_be_binned_and_cut() -> None:
    frames = np.arange(2 * 9 * 10, dtype=np.uint8).reshape(2, 9, 10)
    assert binned(frames, 2).shape == (2, 4, 5)
    assert binned(frames, 2)[0, 0, 0] == np.round(frames[0, :2, :2].mean())
    assert (middle(frames, 5) == frames[:, 2:7, 2:7]).all()
    for call in (lambda: middle(frames, 10), lambda: binned(frames, 11)):
        with pytest.raises(InputError, match=r"px|pixels"):
            call()


def run(*arguments: object) -> dict[str, object]:
    app = typer.Typer()
    app.command()(flow_command.flow)
    result = CliRunner().invoke(app, [*map(str, arguments), "--json"], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def test_the_command_prints_one_object_with_every_frame_and_a_summary(pictures: Path) -> None:
    facts = run(pictures, "--fps", FPS, "--focal", effective_focal_px(CAMERA), "--range", HEIGHT_M)
    assert facts["frames"] == 8
    assert facts["size_px"] == [64, 64]
    assert len(facts["per_frame"]) == 7
    first = facts["per_frame"][0]
    assert set(first) == {"t_s", "flow_x_px", "flow_y_px", "quality", "velocity_x_m_s", "velocity_y_m_s"}
    assert first["t_s"] == pytest.approx(1.0 / FPS)
    assert facts["summary"]["valid"] == 7
    assert facts["summary"]["mean_velocity_m_s"][0] == pytest.approx(0.3, abs=0.075)


def test_the_command_takes_rates_and_leaves_velocity_out_without_a_range(pictures: Path) -> None:
    table = pictures / "rates.csv"
    table.write_text("rate_x_rad_s,rate_y_rad_s,rate_z_rad_s\n" + "0,0.2,0\n" * 8)
    plain = run(pictures, "--fps", FPS)
    turned = run(pictures, "--fps", FPS, "--rates", table)
    assert plain["summary"]["mean_velocity_m_s"] is None
    difference = turned["summary"]["mean_flow_px"][0] - plain["summary"]["mean_flow_px"][0]
    assert difference == pytest.approx(0.2 / FPS * 666.67)
    table.write_text("p,q,r\n1,2,3\n")
    with pytest.raises(InputError, match="rate_x_rad_s"):
        run(pictures, "--fps", FPS, "--rates", table)
