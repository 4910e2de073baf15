"""The suite's own turns: what one worker compiles, another waits for, and no longer than for ever."""

from __future__ import annotations

import pytest

import compile_once
from compile_once import Turns


@pytest.fixture
def workers(tmp_path, monkeypatch):
    monkeypatch.setattr(compile_once, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(compile_once, "HUNG_S", 0.0)
    return Turns(), Turns()


def test_a_name_is_one_workers_until_it_is_given_back(workers):
    one, other = workers
    assert one.take("take_one")
    assert not one.take("take_one")  # it has it
    assert not other.take("take_one")
    assert other.take("fly_block")
    one.give("take_one")
    assert other.take("take_one")


def test_what_nobody_has_is_given_back_in_vain(workers):
    one, other = workers
    one.give("take_one")
    assert other.take("take_one")
