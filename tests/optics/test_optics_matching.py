"""Block matching: known shifts, the firmware's rules against a plain reading of them, its defects, odd images."""

from __future__ import annotations

from contextlib import nullcontext, suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from flownav.core.errors import InputError
from flownav.lab.optics.block_matching import corners
from flownav.lab.optics.firmware import VERSIONS, Firmware, firmware_named
from flownav.lab.optics.flow import flow_between, flow_of_frames, raw_flow

CLEAN = VERSIONS["2014-12"]
Image = NDArray[np.uint8]


def textured(seed: int, shift_x: float = 0.0, shift_y: float = 0.0, size: int = 64, smooth: float = 1.2) -> Image:
    """A repeating random image, moved right and down by a fraction of a pixel exactly (Fourier shift)."""
    noise = np.random.default_rng(seed).standard_normal((size, size))
    fy, fx = np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :]
    spectrum = np.fft.rfft2(noise) * np.exp(-2.0 * (np.pi * smooth) ** 2 * (fx**2 + fy**2))
    scale = 45.0 / np.fft.irfft2(spectrum, (size, size)).std()
    moved = np.fft.irfft2(spectrum * np.exp(-2j * np.pi * (fx * shift_x + fy * shift_y)), (size, size))
    return np.clip(np.round(128.0 + scale * moved), 0, 255).astype(np.uint8)


# -- a plain reading of section 4.3, patch by patch -----------------------------------------------------------
OFFSETS = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]


def half_pixel_patch(image: Image, x: int, y: int, direction: tuple[int, int]) -> NDArray[np.int64]:
    """The 8x8 patch at (x, y), half a pixel further on, by halving averages that round down."""
    whole = image.astype(np.int64)
    dx, dy = direction

    def row_average(y0: int) -> NDArray[np.int64]:
        return (whole[y0 : y0 + 8, x : x + 8] + whole[y0 : y0 + 8, x + dx : x + dx + 8]) // 2

    if dy == 0:
        return row_average(y)
    if dx == 0:
        return (whole[y : y + 8, x : x + 8] + whole[y + dy : y + dy + 8, x : x + 8]) // 2
    return (row_average(y) + row_average(y + dy)) // 2


def plain_match(previous: Image, current: Image, fw: Firmware) -> tuple[float, float, int]:
    before, after = previous.astype(np.int64), current.astype(np.int64)
    found = []
    grid = corners(64, fw)
    for y in grid:
        for x in grid:
            inner = before[y + 2 : y + 6, x + 2 : x + 6]
            down, across = np.abs(np.diff(inner, axis=0)).sum(), np.abs(np.diff(inner, axis=1)).sum()
            if (2 * down if fw.rows_twice_defect else down + across) < fw.feature_threshold:
                continue
            patch, best = before[y : y + 8, x : x + 8], (10**9, 0, 0)
            for sy in range(-fw.search_px, fw.search_px + 1):
                for sx in range(-fw.search_px, fw.search_px + 1):
                    sad = np.abs(patch - after[y + sy : y + sy + 8, x + sx : x + sx + 8]).sum()
                    if sad < best[0]:
                        best = (sad, sx, sy)
            if best[0] >= fw.sad_threshold:
                continue
            least, half = best[0], (0, 0)
            for direction in OFFSETS:
                candidate = half_pixel_patch(current, x + best[1], y + best[2], direction)
                if np.abs(patch - candidate).sum() < least:
                    least, half = np.abs(patch - candidate).sum(), direction
            sign = -1 if fw.half_pixel_y_defect else 1
            found.append((best[1] + 0.5 * half[0], best[2] + sign * 0.5 * half[1]))
    if len(found) <= 10:
        return 0.0, 0.0, 0
    x, y = np.mean(found, axis=0)
    if fw.histogram_filter:
        x, y = (centroid([f[i] for f in found], fw.search_px) for i in (0, 1))
    return float(x), float(y), len(found) * 255 // len(grid) ** 2


def centroid(shifts: list[float], search: int) -> float:
    """Mean of the shifts within two half-pixel bins of the commonest (the first, of equals)."""
    values, counts = np.unique(shifts, return_counts=True)
    peak = values[np.argmax(counts)]
    near = np.abs(values - peak) <= 1.0
    return float((values[near] * counts[near]).sum() / counts[near].sum())


@pytest.mark.parametrize("name", ["2013-06", "2013-09", "2014-07", "2014-12", "2016", "2017", "2020,+histogram"])
def test_the_vectorised_search_equals_a_plain_reading_of_the_firmware(name: str) -> None:
    firmware = firmware_named(name)
    rng = np.random.default_rng(5)
    for seed in range(4):
        previous = textured(seed, smooth=0.6 + 0.4 * seed)
        noisy = textured(seed, 1.3, -2.4, smooth=0.6 + 0.4 * seed) + rng.normal(0.0, 6.0, (64, 64))
        current = np.clip(noisy, 0, 255).astype(np.uint8)
        assert flow_between(previous, current, firmware) == pytest.approx(plain_match(previous, current, firmware))


def test_unrelated_images_give_the_same_flow_as_a_plain_reading() -> None:
    previous, current = np.random.default_rng(3).integers(0, 256, (2, 64, 64)).astype(np.uint8)
    loose = CLEAN._replace(sad_threshold=20_000)
    assert flow_between(previous, current, loose) == pytest.approx(plain_match(previous, current, loose))


# -- known shifts ---------------------------------------------------------------------------------------------
@settings(deadline=None, max_examples=40)
@given(st.floats(-3.5, 3.5), st.floats(-3.5, 3.5), st.integers(0, 1000))
def test_a_known_shift_of_a_random_image_is_found_within_a_quarter_pixel(dx: float, dy: float, seed: int) -> None:
    flow = flow_between(textured(seed), textured(seed, dx, dy), CLEAN)
    # a patch is right to the nearest half pixel; halving averages that round down shift the border a little
    assert abs(flow.x_px - dx) <= 0.25 + 0.06
    assert abs(flow.y_px - dy) <= 0.25 + 0.06
    assert flow.quality == 255


@pytest.mark.parametrize("side", [-0.25, 0.25])
def test_a_quarter_pixel_beyond_a_half_is_seen_as_the_half(side: float) -> None:
    flows = np.array([flow_between(textured(s), textured(s, 1.5 + 0.8 * side), CLEAN)[:2] for s in range(8)])
    np.testing.assert_allclose(flows, np.tile([1.5, 0.0], (8, 1)), atol=0.05)


def test_the_eight_half_pixel_directions_have_the_right_signs() -> None:
    for dx, dy in OFFSETS:
        flow = flow_between(textured(2), textured(2, 0.5 * dx, 0.5 * dy), CLEAN)
        assert (flow.x_px, flow.y_px) == pytest.approx((0.5 * dx, 0.5 * dy), abs=0.08)


@pytest.mark.parametrize("shift", [1, 2, 3])
def test_stripes_moved_by_more_than_half_their_pitch_are_seen_to_move_back(shift: int) -> None:
    pitch = 4
    x = np.arange(64)
    frames = [np.tile(100.0 + 60.0 * np.cos(2.0 * np.pi * (x - s) / pitch), (64, 1)) for s in (0, shift)]
    # a small search window leaves one candidate: the pattern's own period cannot be distinguished
    narrow = CLEAN._replace(search_px=2 if shift < 3 else 1)
    flow = flow_between(*(np.round(f).astype(np.uint8) for f in frames), narrow)
    expected = shift if 2 * shift < pitch else shift - pitch
    assert flow.x_px == pytest.approx(expected)


def test_equal_matches_go_to_the_first_searched() -> None:
    blank = np.full((64, 64), 90, np.uint8)
    flow = flow_between(blank, blank, CLEAN._replace(feature_threshold=0))
    assert (flow.x_px, flow.y_px) == (-4.0, -4.0)


# -- defects ---------------------------------------------------------------------------------------------------
def test_counting_rows_twice_makes_lines_down_the_image_invisible() -> None:
    lines = np.tile((90 + 60 * np.cos(2.0 * np.pi * np.arange(64) / 13.0)).astype(np.uint8), (64, 1))
    assert flow_between(lines, lines, CLEAN).quality > 0
    assert flow_between(lines, lines, firmware_named("2014-12,+rows-twice")).quality == 0
    assert flow_between(lines.T, lines.T, firmware_named("2014-12,+rows-twice")).quality > 0


def test_the_half_pixel_defect_turns_the_sign_in_y_alone() -> None:
    still, moved = textured(4), textured(4, 0.35, 0.35)  # nearest whole pixel 0, so the half is all there is
    flow = flow_between(still, moved, firmware_named("2014-12,+half-pixel-y"))
    assert (flow.x_px, flow.y_px) == pytest.approx((0.5, -0.5), abs=0.1)  # a patch may lie nearer to 1 px


def test_the_histogram_defect_spoils_the_histogram_alone() -> None:
    still, moved = textured(4), textured(4, 1.5, -0.5)
    mean = [flow_between(still, moved, f"2014-12{switch}")[:2] for switch in (",+histogram-index", ",-histogram-index")]
    assert mean[0] == mean[1]
    right = flow_between(still, moved, "2014-12,+histogram,-histogram-index")
    spoilt = flow_between(still, moved, "2014-12,+histogram,+histogram-index")
    assert right[:2] == pytest.approx((1.5, -0.5), abs=0.05)
    assert spoilt[:2] != right[:2]


def test_every_version_has_its_published_grid_and_rate() -> None:
    assert corners(64, VERSIONS["2013-06"]).tolist() == list(range(17, 39, 3))
    assert corners(64, VERSIONS["2013-09"]).tolist() == [5, 11, 17, 23, 29, 35, 41, 47]
    assert corners(64, VERSIONS["2014-07"]).tolist() == [5, 15, 25, 35, 45]
    assert corners(64, VERSIONS["2016"]).tolist() == [9, 17, 25, 33, 41]
    assert [VERSIONS[v].frame_rate_hz for v in ("2014-01", "2014-07")] == [250.0, 400.0]
    assert VERSIONS["2013-09"].gyro_scale == pytest.approx(1.0 - 0.128, abs=5e-4)


@pytest.mark.parametrize("text", ["2013", "2014-12,histogram", "2014-12,+no-such", "2014-12,"])
def test_an_unknown_version_or_switch_is_named(text: str) -> None:
    with pytest.raises(InputError, match="firmware"):
        firmware_named(text)


# -- odd images ---------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("level", [0, 128, 255])
def test_a_blank_frame_has_no_quality(level: int) -> None:
    blank = np.full((64, 64), level, np.uint8)
    assert flow_between(blank, blank) == (0.0, 0.0, 0)
    assert flow_between(blank, textured(1)) == (0.0, 0.0, 0)


IMAGES = st.one_of(
    arrays(np.uint8, (2, 64, 64), elements=st.sampled_from([0, 255])),
    arrays(np.uint8, (2, 64, 64), elements=st.integers(0, 255), fill=st.just(0)),
    st.integers(0, 100).map(lambda s: np.random.default_rng(s).integers(0, 256, (2, 64, 64)).astype(np.uint8)),
)


@settings(deadline=None, max_examples=40)
@given(IMAGES, st.sampled_from(sorted(VERSIONS)))
def test_any_image_gives_a_flow_within_the_search_and_a_quality_within_a_byte(frames: Image, name: str) -> None:
    flow, quality = raw_flow(frames, VERSIONS[name])
    assert np.abs(flow).max() <= VERSIONS[name].search_px + 0.5
    assert quality.min() >= 0
    assert quality.max() <= 255
    assert not flow[quality == 0].any()


@settings(deadline=None, max_examples=60)
@given(st.lists(st.integers(0, 90), min_size=1, max_size=4), st.sampled_from([np.uint8, np.float64, np.int64, bool]))
def test_any_shape_gives_a_flow_or_a_clear_error(shape: list[int], kind: type) -> None:
    frames = np.ones(shape, kind)
    large_enough = len(shape) == 3 and shape[0] >= 2 and min(shape[1:]) >= 64 and kind is not bool
    with nullcontext() if large_enough else suppress(InputError):
        series = flow_of_frames(frames, 30.0)
        assert len(series.quality) == shape[0] - 1
        assert not series.quality.any()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -1.0, 256.0])
def test_values_that_are_no_grey_levels_are_refused(bad: float) -> None:
    frames = np.full((2, 64, 64), 100.0)
    frames[1, 3, 3] = bad
    with pytest.raises(InputError, match="grey levels"):
        flow_of_frames(frames, 30.0)


@pytest.mark.parametrize("size", [(8, 8), (1, 64), (64, 18), (20, 20)])
def test_a_frame_too_small_for_the_patches_is_refused(size: tuple[int, int]) -> None:
    with pytest.raises(InputError, match="too small"):
        flow_of_frames(np.zeros((2, *size), np.uint8), 30.0)


@pytest.mark.parametrize("size", [(48, 64), (64, 200), (241, 321)])
def test_frames_need_not_be_square_nor_64_pixels(size: tuple[int, int]) -> None:
    big = textured(3, size=400)
    rows, columns = size
    frames = np.stack([big[10 + 2 * k : 10 + 2 * k + rows, 9 - 3 * k : 9 - 3 * k + columns] for k in range(3)])
    series = flow_of_frames(frames, 30.0)
    np.testing.assert_allclose(series.flow_px, [[3.0, -2.0]] * 2)


def test_frames_of_two_sizes_are_refused() -> None:
    with pytest.raises(InputError, match="one size"):
        flow_between(np.zeros((64, 64), np.uint8), np.zeros((64, 65), np.uint8))
