"""Epochs that are counted one by one: without contact before a landing, at rest after it, and those of an error."""

from __future__ import annotations

import numpy as np
import pytest

from flownav.scoring.consistency import consistency_of_block, largest_horizontal_error
from flownav.scoring.course import AIRBORNE_EPOCHS, Moving, first_contact, followed, no_touch, nothing_yet
from flownav.scoring.errors import error_statistics
from flownav.scoring.touchdown import STILL_EPOCHS

STANDING = Moving(0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, True, False, False)


def followed_through(contacts: list[bool], **changed: float):
    """Memory after these epochs."""
    course, touch = nothing_yet(), no_touch()
    for epoch, touches in enumerate(contacts):
        course, touch = followed(course, touch, epoch, STANDING._replace(touches=touches, **changed))
    return course, touch


@pytest.mark.parametrize("lanes", [1, 3])
def test_a_contact_counts_after_exactly_as_many_epochs_aloft(lanes):
    for aloft, expected in ((AIRBORNE_EPOCHS - 1, -1), (AIRBORNE_EPOCHS, AIRBORNE_EPOCHS + 4)):
        pattern = np.array([1.0] * 4 + [0.0] * aloft + [1.0] * 5)
        found = first_contact(np.tile(pattern[:, None], (1, lanes)))
        assert found.tolist() == [expected] * lanes
        course, _ = followed_through([bool(touches) for touches in pattern])
        assert course.contact == expected


def test_epochs_without_contact_and_at_rest_are_counted_one_by_one():
    for count in (1, 2, STILL_EPOCHS - 1, STILL_EPOCHS, STILL_EPOCHS + 7):
        assert followed_through([False] * count)[0].untouched == count
        assert followed_through([True] * count)[0].still == count
        assert followed_through([True] * count, yaw_deg_s=15.1)[0].still == 0
        assert followed_through([True] * count, yaw_deg_s=14.9)[0].still == count


def followed_along(places, **changed):
    """Memory of a vehicle on the ground that is at these places (north, east) one after the other."""
    course, touch = nothing_yet(), no_touch()
    for epoch, (north, east) in enumerate(places):
        at = STANDING._replace(place_n=north, place_e=east, **changed)
        course, touch = followed(course, touch, epoch, at)
    return course


@pytest.mark.parametrize("axis", [0, 1])
def test_a_vehicle_that_rocks_on_its_skids_stands_and_one_that_slides_does_not(axis):
    """Rocking at 2 Hz within 1.5 cm is up to 0.1 m/s; sliding at 0.04 m/s leaves the place within a second."""
    t_s = 0.02 * np.arange(200)
    places = np.full((200, 2), 5.0)
    places[:, axis] += 0.0075 * np.sin(2.0 * np.pi * 2.0 * t_s)
    assert followed_along(places, lateral_m_s=0.09).still == 200
    places[:, axis] = 5.0 + 0.04 * t_s
    assert followed_along(places).still < STILL_EPOCHS
    places[:, axis] = 5.0 + np.where(t_s < 1.0, 0.0, 0.031)  # pushed once by more than 3 cm
    assert followed_along(places).still == 150
    places[:, axis] = 5.0 + np.where(t_s < 1.0, 0.0, 0.029)
    assert followed_along(places).still == 200


def test_a_go_around_is_counted_once_however_long_it_lasts():
    course, touch = nothing_yet(), no_touch()
    for epoch, away in enumerate([False] * 3 + [True] * 7 + [False] * 4 + [True] * 2):
        course, touch = followed(course, touch, epoch, STANDING._replace(touches=False, away=away))
    assert course.go_arounds == 2


def test_statistics_are_of_the_epochs_that_count_and_of_each_once():
    """Against NumPy, of two states and of two lanes that do not count alike."""
    rng = np.random.default_rng(5)
    estimate, truth = rng.normal(size=(2, 40, 2, 2))
    counted = rng.integers(0, 2, (40, 2)).astype(float)
    found = error_statistics(estimate, truth, counted)
    for lane in range(2):
        error = (estimate - truth)[counted[:, lane] > 0.0, :, lane]
        expected = [error.mean(axis=0), error.std(axis=0), np.sqrt((error**2).mean(axis=0)), np.abs(error).max(axis=0)]
        np.testing.assert_allclose(found[lane], np.transpose(expected))


def test_a_block_of_flights_has_each_of_its_epochs_once():
    """Of 30 epochs the filter runs from the fifth on, and the first ten are on the ground."""
    rng = np.random.default_rng(6)
    error = rng.normal(size=(30, 6, 4))
    nees = (error**2).sum(axis=1)
    nees[:5] = np.nan
    on_ground = np.zeros((30, 4))
    on_ground[:10] = 1.0
    sums = consistency_of_block(error, np.ones_like(error), nees, np.full((30, 4), 2.0), on_ground)
    assert sums.flights == 4
    assert sums.running.tolist() == [0] * 5 + [4] * 25
    assert sums.airborne.tolist() == [0] * 10 + [4] * 20
    assert sums.errors.steps.sum() == 80
    np.testing.assert_allclose(sums.errors.root_mean_square(), np.sqrt((error[10:] ** 2).mean(axis=(0, 2))))


@pytest.mark.parametrize("axis", [0, 1])
def test_the_largest_horizontal_error_is_that_of_either_axis(axis):
    truth, counted = np.zeros((9, 3, 2)), np.ones((9, 2))
    estimate = truth.copy()
    estimate[:, axis, 0] = np.linspace(0.0, 4.0, 9)
    estimate[:, axis, 1] = -3.0
    estimate[:, 2] = 100.0
    assert largest_horizontal_error(estimate, truth, None, counted).tolist() == [4.0, 3.0]
    assert largest_horizontal_error(estimate, truth, 4, counted).tolist() == [2.0, 0.0]
