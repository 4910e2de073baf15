"""Numbers as text and as JSON."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from flownav.core.text import finite, finite_or_none, harmless


@pytest.mark.parametrize("value", [None, math.nan, math.inf, -math.inf, np.float64("nan")])
def test_what_json_has_no_number_for_is_none(value):
    assert finite_or_none(value) is None


def test_a_number_is_a_plain_float_of_the_same_value():
    assert finite_or_none(np.float64(0.1)) == 0.1
    assert type(finite_or_none(np.float64(0.1))) is float


def test_all_within_a_value_can_be_said_and_what_is_no_number_stays():
    told = {"a": (1.5, math.nan, [np.float64(-math.inf), "text"]), "b": {"c": 3, "d": True, "e": None}}
    said = {"a": [1.5, None, [None, "text"]], "b": {"c": 3, "d": True, "e": None}}
    assert finite(told) == said
    assert json.loads(json.dumps(finite(told), allow_nan=False)) == said


def test_what_would_command_a_terminal_is_written_as_an_escape():
    assert harmless("pass\x1b[2J\x1b[1;1HHOLDS\r\x07\x9b\x7f") == r"pass\x1b[2J\x1b[1;1HHOLDS\r\x07\x9b\x7f"
    assert harmless("5 µg/√Hz, café\t│\n") == "5 µg/√Hz, café\t│\n"
