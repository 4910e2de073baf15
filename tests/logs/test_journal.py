"""The journal's format: what was written is read, however the file was cut off or damaged."""

from __future__ import annotations

import random
import struct
import time

import numpy as np
import pytest

from flownav.core.errors import InputError
from flownav.logs.journal import HEADER, MAGIC, MARK, Block, Damage, block, blocks
from flownav.logs.open_log import log_kind, open_log

ROWS = {"fed": np.arange(12.0).reshape(3, 4), "event": np.full((1, 3), np.nan)}
WHOLE = [block(number, {"notes": [[0.5, "a", f"b{number}"]]}, ROWS) for number in range(4)]
FILE = MAGIC + b"".join(WHOLE)


def read(data):
    return list(blocks(memoryview(data)))


def numbers(parts):
    return [part.number for part in parts if isinstance(part, Block)]


def test_what_was_written_is_read():
    parts = read(FILE)
    assert numbers(parts) == [0, 1, 2, 3]
    assert len(parts) == 4
    assert parts[2].stated == {"notes": [[0.5, "a", "b2"]]}
    for name, values in ROWS.items():
        np.testing.assert_array_equal(parts[3].rows[name], values)


def test_a_file_cut_off_anywhere_holds_every_block_before_the_cut():
    ends = np.cumsum([len(MAGIC), *map(len, WHOLE)])
    for cut in range(len(MAGIC), len(FILE)):
        parts = read(FILE[:cut])
        whole = int(np.searchsorted(ends, cut, side="right")) - 1
        assert numbers(parts) == list(range(whole))
        torn = cut - int(ends[whole])
        assert [part for part in parts if isinstance(part, Damage)] == (
            [Damage(int(ends[whole]), torn, True)] * (torn > 0)
        )


def test_a_tail_of_zeros_is_a_torn_tail():
    """The file after a power cut: the length is there, the bytes are not."""
    parts = read(FILE + bytes(5000))
    assert numbers(parts) == [0, 1, 2, 3]
    assert parts[-1] == Damage(len(FILE), 5000, True)


@pytest.mark.parametrize("place", range(0, 40))
def test_any_wrong_bit_costs_its_block_alone(place):
    at = len(MAGIC) + len(WHOLE[0]) + place
    spoilt = bytearray(FILE)
    spoilt[at] ^= 4
    parts = read(bytes(spoilt))
    assert numbers(parts) == [0, 2, 3]
    assert [part for part in parts if isinstance(part, Damage)] == [
        Damage(len(MAGIC) + len(WHOLE[0]), len(WHOLE[1]), False)
    ]


def test_bytes_that_are_gone_or_too_many_cost_no_other_block():
    start = len(MAGIC) + len(WHOLE[0])
    assert numbers(read(FILE[: start + 50] + FILE[start + 57 :])) == [0, 2, 3]
    assert numbers(read(FILE[:start] + b"\xf7\x9aBK" * 5 + FILE[start:])) == [0, 1, 2, 3]


def test_noise_between_blocks_is_read_in_time():
    noise = random.Random(2).randbytes(3_000_000) + MARK * 500_000
    before_s = time.process_time()
    parts = read(FILE + noise + b"".join(WHOLE))
    assert numbers(parts) == [0, 1, 2, 3] * 2
    assert time.process_time() - before_s < 5.0


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"\xff\xff\xff\xff",
        struct.pack("<I", 2) + b"[]",
        struct.pack("<I", 4) + b"nope",
        struct.pack("<I", 26) + b'{"rows": {"fed": [9, 9]}} ',
        struct.pack("<I", 27) + b'{"rows": {"fed": [-1, -1]}}',
        struct.pack("<I", 200_000) + b"[" * 200_000,
    ],
)
def test_a_payload_of_another_make_is_damage(payload):
    import zlib

    head = HEADER.pack(MARK, 0, len(payload), zlib.crc32(payload), 0)[:-4]
    made = MAGIC + head + struct.pack("<I", zlib.crc32(head)) + payload + WHOLE[1]
    assert numbers(read(made)) == [1]


def test_whoever_opens_a_journal_is_told_to_recover_it(tmp_path):
    path = tmp_path / "flight.fnr.journal"
    path.write_bytes(FILE)
    assert log_kind(path) == "journal"
    assert not log_kind(tmp_path / "none")
    for asked in (path, tmp_path / "flight.fnr"):
        with pytest.raises(InputError, match=r"did not end; `flownav recover .*flight\.fnr\.journal`"):
            open_log(asked)
