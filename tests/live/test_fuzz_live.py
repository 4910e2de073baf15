"""Damaged links: whatever arrives, a session goes on, soon, in little memory, and sends finite numbers only."""

from __future__ import annotations

import math
import time
import tracemalloc
from random import Random

import pytest

from flownav.live.filtering import Keeper
from flownav.live.loop import warm_up
from flownav.live.options import Options
from flownav.live.session import Session
from flownav.logs.mavlink.framing import coder
from fuzzing import FIRST_SEED, MUTANTS
from link_mutations import mutate_piece
from live_ends import START_S, STEP_S, UNIX_S, Hover

PIECES = 25  # damaged datagrams in one session
FLOWN_S = 2.5
LONGEST_STEP_S = 1.0  # of the processor
MOST_BYTES = 32 << 20
SENT = ("ODOMETRY", "VISION_POSITION_ESTIMATE", "LANDING_TARGET")
KEY = bytes(range(32))


def numbers_of(message) -> list[float]:
    """Every number that a message carries, but for what stands for a covariance that is not known."""
    found = []
    for name in message.ordered_fieldnames:
        value = getattr(message, name)
        if isinstance(value, float | int):
            found.append(float(value))
        elif isinstance(value, list | tuple) and "covariance" not in name:
            found += map(float, value)
    return found


def fly_damaged(seed: int) -> None:
    """A hover of some seconds, its datagrams damaged by a seed; what is broken raises."""
    random = Random(seed)
    key = KEY if seed % 5 == 4 else None
    send = ("odometry", "vision", "landing-target", "none")[seed % 4]
    session = Session(Options(send=send, key=key), Keeper(), START_S, UNIX_S)
    vehicle, hears = Hover(key=key), coder()
    struck = {random.randrange(round(FLOWN_S / STEP_S)) for _ in range(PIECES)}
    now_s, earlier, whole = START_S, b"", seed % 3 != 0
    for step in range(round(FLOWN_S / STEP_S)):
        now_s += STEP_S
        for piece in vehicle.frames(now_s - START_S):
            arriving = mutate_piece(piece, earlier, random) if step in struck else [piece]
            earlier = piece
            for each in arriving:
                begun = time.thread_time()
                session.take(each, now_s, whole=whole)
                assert time.thread_time() - begun < LONGEST_STEP_S
        if step in struck and random.random() < 0.2:
            now_s += random.choice((0.05, 0.5, 3.0))  # nothing came for a while
        begun = time.thread_time()
        session.tick(now_s)
        assert time.thread_time() - begun < LONGEST_STEP_S
        assert len(session.outbox) <= 1024
        while session.outbox:
            message = hears.decode(bytearray(session.outbox.popleft()))
            if message.msgname in SENT:
                assert all(map(math.isfinite, numbers_of(message))), message


@pytest.mark.fuzz
def test_a_session_outlives_what_a_link_brings():
    warm_up()
    tracemalloc.start()
    try:
        for seed in range(FIRST_SEED, FIRST_SEED + -(-MUTANTS // PIECES)):
            tracemalloc.reset_peak()
            before = tracemalloc.get_traced_memory()[0]
            try:
                fly_damaged(seed)
            except Exception as error:
                raise AssertionError(f"seed {seed}: {type(error).__name__}: {error}") from error
            assert tracemalloc.get_traced_memory()[1] - before < MOST_BYTES, f"seed {seed}"
    finally:
        tracemalloc.stop()
