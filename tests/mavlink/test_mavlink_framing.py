"""Frames in bytes: what pymavlink packs is found whole, in pieces and after damage, and nothing damaged is believed."""

from __future__ import annotations

import random
from collections import Counter

import pytest

from flownav.logs.mavlink.framing import Decoder, StreamFrames, coder, dialect, tlog_frames
from mavlink_logs import flight_log, made

LOG = flight_log(2.0)


@pytest.mark.parametrize("v1", [False, True])
def test_every_frame_of_a_log_is_found_with_its_arrival(v1):
    log = flight_log(1.0)
    if v1:
        log.frames.clear()
        for k in range(20):
            log.add(0.1 * k, made("ATTITUDE", time_boot_ms=100 * k, roll=0.1), v1=True)
    damage: Counter[str] = Counter()
    found = list(tlog_frames(log.content, damage))
    assert [frame.arrival_us for frame in found] == [arrival for arrival, _ in log.frames]
    assert [log.content[frame.start : frame.end] for frame in found] == [packed for _, packed in log.frames]
    assert not +damage


@pytest.mark.parametrize("size", [1, 3, 50, 1000])
def test_a_link_gives_the_same_frames_in_whatever_pieces_they_come(size):
    content = b"".join(packed for _, packed in LOG.frames)
    stream = StreamFrames()
    found = [whole for k in range(0, len(content), size) for _, whole in stream.feed(content[k : k + size])]
    assert found == [packed for _, packed in LOG.frames]
    assert not +stream.damage


def test_one_changed_byte_costs_its_own_frame_alone():
    draw = random.Random(4)
    for _ in range(40):
        k = draw.randrange(2, len(LOG.frames) - 2)
        packed = bytearray(LOG.frames[k][1])
        packed[draw.randrange(10, len(packed))] ^= 1 << draw.randrange(8)
        others = [frame for i, (_, frame) in enumerate(LOG.frames) if i != k]
        stream = StreamFrames()
        content = b"".join(bytes(packed) if i == k else frame for i, (_, frame) in enumerate(LOG.frames))
        assert [whole for _, whole in stream.feed(content)] == others
        assert stream.damage["bad_checksum"] >= 1


def framed(number, body, extra, *, v1=False):
    """A frame of a payload, whatever is in it."""
    head = bytes([0xFE, len(body), 7, 3, 1, number]) if v1 else bytes([0xFD, len(body), 0, 1, 7, 3, 1])
    head += b"" if v1 else number.to_bytes(3, "little")
    return head + body + dialect().x25crc(bytearray(head[1:] + body + bytes([extra]))).crc.to_bytes(2, "little")


def test_messages_are_those_that_pymavlink_decodes():
    """Every message of the dialect with any bytes, with zeros cut off at the end and with fields that are not known."""
    draw, ours, theirs = random.Random(3), Decoder(), coder()
    for number, kind in dialect().mavlink_map.items():
        for cut in (0, 0, 3, -2):
            body = bytes(draw.choice((0, draw.randrange(256))) for _ in range(kind.unpacker.size)) + b"\1\2"
            body = body[: max(1, min(255, kind.unpacker.size - cut))]
            for v1 in {False, number < 256 and cut >= 0}:
                frame = framed(number, body, kind.crc_extra, v1=v1)
                found, wanted = (vars(end.decode(bytearray(frame))) for end in (ours, theirs))
                headers = [vars(fields.pop("_header")) for fields in (found, wanted)]
                assert repr(found) == repr(wanted), kind.msgname
                assert headers[0] == headers[1]
