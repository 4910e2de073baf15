"""Invariances of a path that is flown again: drag, wind, north and time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from flownav.core.frames import GRAVITY_M_S2
from flownav.studies.validation.path import FlownPath, Lean

KNOTS_S = np.linspace(0.0, 20.0, 81)


def flown(velocity=(0.0, 0.0, 0.0), heading: float = 0.0, lean=(0.0, 0.0, 0.0), shift_s: float = 0.0, way=None):
    """A straight, level flight, high over the ground; or along `way` (n, 3) on KNOTS_S."""
    t_s = KNOTS_S + shift_s
    place = np.outer(KNOTS_S, velocity) + np.array([0.0, 0.0, -5.0]) if way is None else way
    position = make_interp_spline(t_s, place, k=5)
    return FlownPath(position, make_interp_spline(t_s, np.full(len(t_s), heading), k=5), Lean(*lean), 0.1,
                     (float(t_s[0]), float(t_s[-1])))  # fmt: skip


def down_axis(path: FlownPath, t_s: float = 10.0) -> np.ndarray:
    return path.attitude(np.array([t_s])).as_matrix()[0, :, 2]


def test_drag_is_leant_against_nose_first():
    """In steady flight the thrust carries the weight and the drag k v: the body's down axis points forward of none."""
    ahead = down_axis(flown(velocity=(4.0, 0.0, 0.0), lean=(0.5, 0.0, 0.0)))
    assert ahead[0] / ahead[2] == pytest.approx(-0.5 * 4.0 / GRAVITY_M_S2)
    assert ahead[1] == pytest.approx(0.0, abs=1e-9)
    felt = flown(velocity=(4.0, 0.0, 0.0), lean=(0.5, 0.0, 0.0)).force_m_s2(np.array([10.0]), 0.01)[0]
    assert felt[0] == pytest.approx(-0.5 * 4.0 / math.hypot(1.0, 0.5 * 4.0 / GRAVITY_M_S2), rel=1e-6)  # the drag alone


def test_hovering_in_a_wind_is_flying_through_still_air():
    hover = down_axis(flown(lean=(0.5, -3.0, 2.0)))
    through = down_axis(flown(velocity=(3.0, -2.0, 0.0), lean=(0.5, 0.0, 0.0)))
    assert hover == pytest.approx(through)
    with_the_wind = down_axis(flown(velocity=(3.0, -2.0, 0.0), lean=(0.5, 3.0, -2.0)))
    assert with_the_wind == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)


@pytest.mark.parametrize(("turn", "shift_s"), [(0.5 * math.pi, 0.0), (-2.0, 0.0), (0.0, 512.0)])
def test_a_path_elsewhere_and_later_is_flown_alike(turn, shift_s):
    """Rates and forces, body FRD, of a winding path in wind."""
    way = np.column_stack([3.0 * np.sin(0.4 * KNOTS_S), 2.0 * np.cos(0.3 * KNOTS_S), -5.0 + np.sin(0.2 * KNOTS_S)])
    c, s = math.cos(turn), math.sin(turn)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    wind = rotation @ [1.0, -2.0, 0.0]
    here = flown(way=way, heading=0.3, lean=(0.4, 1.0, -2.0))
    there = flown(way=way @ rotation.T, heading=0.3 + turn, lean=(0.4, wind[0], wind[1]), shift_s=shift_s)
    t_s = np.linspace(3.0, 17.0, 40)
    for name in ("turn_rad_s", "force_m_s2"):
        found = getattr(there, name)(t_s + shift_s, 0.02)
        np.testing.assert_allclose(found, getattr(here, name)(t_s, 0.02), atol=1e-6)
    np.testing.assert_allclose(there.body_velocity_m_s(t_s + shift_s), here.body_velocity_m_s(t_s), atol=1e-8)


def test_beyond_its_ends_a_path_stands_where_it_ended():
    path = flown(velocity=(1.0, 0.0, 0.0))
    found = path.position_m(np.array([-9.0, 0.0, 20.0, 99.0]))
    np.testing.assert_allclose(found, [[0, 0, -5], [0, 0, -5], [20, 0, -5], [20, 0, -5]], atol=1e-9)
