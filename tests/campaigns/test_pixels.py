"""Flights on rendered frames: what the detector saw is what the navigator was fed, along the flight that it led to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flownav.campaigns.local import fly_recorded
from flownav.campaigns.pixels import (
    MOTION,
    agreement,
    chance_of,
    eye_of,
    fly_on_pixels,
    frame_of,
    mounting_rad,
    pose_of,
    taken_epochs,
)
from flownav.core.errors import InputError
from flownav.core.parameter_files import check
from flownav.lab.optics.pad_fix import truth_of
from flownav.simulation.assemble import assemble
from flownav.simulation.engine import fly_one
from flownav.simulation.history import columns
from flownav.simulation.onboard import PAD_SEEN
from flownav.simulation.scenario import Scenario, load_scenario

HOVER = {
    "duration_s": 5.0,
    "path": [{"t_s": 0.0, "height_m": 1.5}, {"t_s": 5.0, "height_m": 1.0}],
    "may_land_after_s": None,
}


def setup(**sections):
    entries = load_scenario("approach").model_dump(exclude_unset=True)
    for key, value in sections.items():
        entries[key] = {**entries.get(key, {}), **value} if isinstance(value, dict) else value
    return assemble(check(entries, Scenario, "test"))


@pytest.fixture(scope="module")
def flown():
    chosen = setup(flight=HOVER, filter={"handover_s": 1.0}, optics="pixels")
    seen, frames = fly_on_pixels(chosen, 1)
    return chosen, seen, frames, fly_one(seen.flight, 1)


def test_the_pad_is_found_in_most_frames(flown) -> None:
    _, _, frames, _ = flown
    assert len(frames) >= 45
    assert sum(f.found for f in frames) > 0.8 * sum(f.whole for f in frames) > 30
    assert not any(f.wrong for f in frames)
    assert all(0.8 < f.height_m < 1.9 for f in frames)


def test_every_frame_of_the_flown_path_gives_what_the_flight_was_flown_on(flown) -> None:
    """The loop is closed exactly: rendering anew along the last flight changes nothing."""
    chosen, seen, _, history = flown
    clock, table = seen.flight.onboard.carried.pad_camera.clock, seen.flight.onboard.pad_seen.reshape(-1, PAD_SEEN)
    motion, eye = history[:, columns("truth", MOTION), 0], eye_of(chosen, 1, 0, None)
    rendered = 0
    for k in range(0, len(table), 7):
        epoch = clock.first + k * clock.every
        again = frame_of(eye, motion[epoch], 0.02 * epoch, k)
        assert again is not None
        np.testing.assert_array_equal(again[1], table[k])
        rendered += 1
    assert rendered >= 7


def test_the_navigator_was_fed_what_was_seen_and_its_path_differs_from_the_models(flown) -> None:
    chosen, seen, _, history = flown
    record = fly_recorded(seen, 1)
    table = seen.flight.onboard.pad_seen.reshape(-1, PAD_SEEN)
    fed = record.tables["pad"]
    found = table[table[:, 3] > 0.0][: len(fed["tan_forward"])]
    assert len(found) >= 30
    np.testing.assert_array_equal(fed["tan_forward"], found[:, 0])
    np.testing.assert_array_equal(fed["distance_m"], found[:, 2])
    by_model = fly_one(chosen.flight, 1)
    taken = taken_epochs(chosen)[np.flatnonzero(table[:, 3] > 0.0)[0]]
    place = columns("truth", MOTION[:3])
    np.testing.assert_array_equal(by_model[: chosen.flight.onboard.carried.pad_camera.clock.first, place],
                                  history[: chosen.flight.onboard.carried.pad_camera.clock.first, place])  # fmt: skip
    assert np.abs(by_model[taken + 50 :, place] - history[taken + 50 :, place]).max() > 1e-5


def test_errors_are_as_large_as_the_datasheet_says(flown) -> None:
    chosen, _, frames, _ = flown
    sheet = chosen.fitted.sheets.pad_camera
    (band, *_) = rows = agreement(frames, sheet)
    assert sum(row["frames"] for row in rows) == len(frames)
    assert band["angle_rms_rad"] < 4.0 * band["expected_angle_rad"]
    assert band["distance_rms"] < 4.0 * band["expected_distance"]
    p = sheet.parameters()
    assert 0.5 < chance_of(p, frames[0]) < 1.0
    assert chance_of(p, frames[0]._replace(shown_m=9.0)) == 0.0


def test_the_lens_is_where_the_model_has_it_and_turned_by_its_mounting(flown) -> None:
    chosen, *_ = flown
    eye = eye_of(chosen, 1, 0, None)
    level = np.array([0.3, -0.2, -1.5, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    pose, motion = pose_of(eye, level, mounted=False)
    forward, right, down = eye.lens_m
    assert pose[:3] == pytest.approx((0.3 + forward, -0.2 + right, 1.5 - down))
    assert motion == pytest.approx((0.0,) * 6)
    truth, turned = (truth_of(pose_of(eye, level, mounted=m)[0], eye.flown.target) for m in (False, True))
    off = np.hypot(turned.tan_forward - truth.tan_forward, turned.tan_right - truth.tan_right)
    assert 0.0 < off < 6.0 * mounting_rad(chosen.fitted.sheets.pad_camera, eye.flown)
    turning = level.copy()
    turning[10:13] = 0.0, 0.4, 0.0
    assert pose_of(eye, turning)[1][:3] == pytest.approx((0.4 * down, 0.0, -0.4 * forward))


def test_what_has_no_frames_says_so() -> None:
    with pytest.raises(InputError, match="needs a pad camera"):
        fly_on_pixels(setup(pad_fix=None, flight=HOVER), 1)
    chosen = setup(flight=HOVER)
    sheet = chosen.fitted.sheets.pad_camera.model_copy(update={"camera": ""})
    without = chosen.fitted._replace(sheets=chosen.fitted.sheets.model_copy(update={"pad_camera": sheet}))
    with pytest.raises(InputError, match="names no camera to render"):
        fly_on_pixels(replace(chosen, fitted=without), 1)
