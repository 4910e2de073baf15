"""Rejection reasons: stable codes, one sentence each."""

from __future__ import annotations

import pytest

from flownav.estimation.gating import MESSAGES, Reason


def test_codes_are_those_that_records_hold():
    assert {reason.name: reason.value for reason in Reason} == {
        "FUSED": 0, "INNOVATION_GATE": 1, "NO_DATA": 2, "NOT_FINITE": 3, "OUT_OF_RANGE": 4, "NO_HEIGHT": 5,
        "TILTED": 6, "BEFORE_START": 7, "DATUM": 8, "OUTAGE": 9,
        "DUPLICATE": 10, "LATE": 11, "STUCK": 12, "NEAR_GROUND": 13, "NOT_NEEDED": 14, "AHEAD": 15, "NO_HEADING": 16,
    }  # fmt: skip


@pytest.mark.parametrize("reason", list(Reason))
def test_every_reason_has_a_label_and_a_sentence(reason):
    assert reason.label == reason.name.lower()
    assert reason.message.endswith(".")
    assert len(reason.message) > 20


def test_no_sentence_stands_twice():
    assert len(set(MESSAGES.values())) == len(Reason) == len(MESSAGES)
