"""Boxes of accelerations, by which medians need not be reckoned."""

from __future__ import annotations

import random
from statistics import median

from flownav.live.inertial import APART_M_S2, KEPT_S, _Span, are_near


def test_forces_of_boxes_that_are_near_have_medians_that_are_not_apart():
    chance, near = random.Random(3), 0
    for _ in range(300):
        spans, medians = (_Span(), _Span()), []
        for span in spans:
            centre, width = chance.uniform(-1.0, 1.0), chance.uniform(0.0, 0.8)
            forces = [[chance.uniform(centre - width, centre + width) for _ in "xyz"] for _ in range(9)]
            for k, force in enumerate(forces):
                span.take(0.1 * k, *force)
            medians.append([median(axis) for axis in zip(*forces, strict=True)])
        apart = sum((a - b) ** 2 for a, b in zip(*medians, strict=True)) ** 0.5
        if are_near(spans[0].box, spans[1].box):
            near += 1
            assert apart <= APART_M_S2
    assert 30 < near < 270


def test_a_force_leaves_its_box_after_two_spells_and_not_before_one():
    span = _Span()
    span.take(0.0, 9.0, 0.0, 0.0)
    for step in range(1, 30):
        t_s = 0.1 * step
        span.take(t_s, 0.0, 0.0, 0.0)
        if t_s < KEPT_S:
            assert span.box[3] == 9.0
    assert span.box[3] == 0.0
