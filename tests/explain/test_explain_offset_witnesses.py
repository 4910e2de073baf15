"""An offset of the flow against a position reference and GPS: of two that contradict each other the lesser counts."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flownav.lab.identification.offset import Offset
from flownav.lab.identification.quantities import Interval
from flownav.studies.explain import measured_signs
from flownav.studies.explain.sign import Lack, Sign

SURE, UNSURE = 0.005, 0.05  # rad/s, standard errors


def witness(name: str, x: float, y: float, sigma: float) -> Any:
    offset = Offset(Interval.of(x, sigma), Interval.of(y, sigma))
    return SimpleNamespace(offset=offset, flown=SimpleNamespace(reference_name=name))


def case(truth: Any, gps: Any) -> Any:
    flow = SimpleNamespace(t_s=np.arange(3.0), value=np.zeros((3, 4)))
    return SimpleNamespace(flow=flow, measured=truth, measured_by_gps=gps, flight_s=(0.0, 2.0))


@pytest.mark.parametrize(("x", "y"), [(0.08, 0.0), (0.0, -0.08)])
@pytest.mark.parametrize(
    ("gps_x", "gps_sigma", "is_one", "by"),
    [
        ("same", SURE, True, "truth.csv"),
        (0.0, SURE, False, "GPS"),  # the reference drifts
        (0.0, UNSURE, True, "truth.csv"),  # GPS cannot tell
    ],
)
def test_of_witnesses_that_contradict_each_other_the_lesser_offset_counts(x, y, gps_x, gps_sigma, is_one, by):
    gps = witness("GPS", x, y, gps_sigma) if gps_x == "same" else witness("GPS", 0.0, 0.0, gps_sigma)
    found = measured_signs.offset(case(witness("truth.csv", x, y, SURE), gps))
    assert isinstance(found, Sign)
    assert (found.strength > 1.0) == is_one
    assert found.figures["reference"] == by


def test_one_witness_is_believed_and_none_lacks():
    alone = measured_signs.offset(case(witness("truth.csv", 0.0, 0.08, SURE), None))
    assert isinstance(alone, Sign)
    assert alone.strength > 1.0
    nameless = SimpleNamespace(offset=None, flown=None)  # its reference drifts all the time
    left = measured_signs.offset(case(nameless, witness("GPS", 0.0, 0.0, SURE)))
    assert isinstance(left, Sign)
    assert left.strength < 0.1
    assert isinstance(measured_signs.offset(case(nameless, None)), Lack)
