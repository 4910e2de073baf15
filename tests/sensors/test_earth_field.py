"""Declination by the World Magnetic Model, against a table of another model."""

from __future__ import annotations

import math

import pytest
from pymavlink.mavextra import get_mag_field_ef

from flownav.sensors.magnetometer import declination_rad

# the model's values in 2026, to 0.1 deg
TOWNS = {
    "Boulder": (40.0, -105.3, 7.7), "Seattle": (47.6, -122.3, 15.0), "Boston": (42.4, -71.1, -14.0),
    "Zurich": (47.4, 8.5, 3.5), "Reykjavik": (64.1, -21.9, -11.2), "St Petersburg": (59.9, 30.3, 12.1),
    "Sydney": (-33.9, 151.2, 12.8), "Auckland": (-36.8, 174.8, 20.3), "Tokyo": (35.7, 139.7, -7.9),
}  # fmt: skip


@pytest.mark.parametrize("town", TOWNS)
def test_the_needle_points_where_it_is_known_to(town):
    """ArduPilot's table is of another model (IGRF), some years older and ten degrees apart."""
    latitude, longitude, declination_deg = TOWNS[town]
    ours = math.degrees(declination_rad((latitude, longitude, 100.0)))
    assert ours == pytest.approx(declination_deg, abs=0.1)
    assert ours == pytest.approx(get_mag_field_ef(latitude, longitude)[0], abs=1.0)


@pytest.mark.parametrize("origin", [
    None, (math.nan, 8.5, 0.0), (47.4, math.inf, 0.0), (47.4, 8.5, math.nan), (91.0, 0.0, 0.0), (0.0, 181.0, 0.0),
])  # fmt: skip
def test_nowhere_there_is_no_declination(origin):
    assert declination_rad(origin) == 0.0


@pytest.mark.parametrize("latitude", [90.0, -90.0])
@pytest.mark.parametrize("longitude", [-180.0, 0.0, 123.0, 180.0])
def test_at_the_poles_it_is_a_number(latitude, longitude):
    assert abs(declination_rad((latitude, longitude, 0.0))) <= math.pi


def test_places_less_than_a_tenth_of_a_degree_apart_have_one_declination_and_altitude_none():
    assert declination_rad((47.371, 8.541, 0.0)) == declination_rad((47.449, 8.459, 4000.0))
    assert declination_rad((47.4, 8.5, 0.0)) != declination_rad((47.6, 8.5, 0.0))


def test_the_date_line_is_one_line():
    assert declination_rad((10.0, 180.0, 0.0)) == pytest.approx(declination_rad((10.0, -180.0, 0.0)), abs=1e-9)
