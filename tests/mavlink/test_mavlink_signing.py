"""Signing: key files, and who is listened to. All with packed bytes."""

from __future__ import annotations

import struct

import pytest

from flownav.core.errors import InputError
from flownav.logs.mavlink.framing import coder
from flownav.logs.mavlink.signing import SignatureCheck, load_key, sign_outgoing, timestamp_at
from mavlink_logs import made

KEY, OTHER_KEY = bytes(range(32)), bytes(32)
NOW = 1_800_000_000.0


def signer(key=KEY, unix_s=NOW, *, system=7, link_id=0):
    mav = coder(system, 1)
    sign_outgoing(mav, key, unix_s, link_id=link_id)
    return mav


def packed(mav, **fields):
    return bytes(made("ATTITUDE", **({"time_boot_ms": 5} | fields)).pack(mav))


def checker():
    return SignatureCheck(KEY, NOW)


def test_signed_packets_are_accepted_in_order():
    check, mav = checker(), signer()
    assert all(check.accepts(packed(mav)) for _ in range(5))
    assert (check.accepted, dict(check.rejected)) == (5, {})


def test_pymavlink_reads_what_it_signed():
    frame = packed(signer(), roll=0.5)
    assert coder().decode(bytearray(frame)).roll == 0.5
    assert frame[2] == 1


def test_unsigned_packets_are_rejected():
    check = checker()
    assert not check.accepts(packed(coder(7, 1)))
    assert not check.accepts(bytes(made("ATTITUDE", time_boot_ms=5).pack(coder(7, 1), force_mavlink1=True)))
    assert not check.accepts(b"")
    assert dict(check.rejected) == {"unsigned": 3}


def test_another_key_is_rejected():
    check = checker()
    assert not check.accepts(packed(signer(OTHER_KEY)))
    assert dict(check.rejected) == {"bad_signature": 1}


def test_a_packet_played_again_is_rejected():
    check, mav = checker(), signer()
    first, second = packed(mav), packed(mav)
    assert check.accepts(first)
    assert check.accepts(second)
    assert not check.accepts(second)
    assert not check.accepts(first)
    assert dict(check.rejected) == {"replayed": 2}


def test_every_changed_bit_is_noticed():
    frame = packed(signer(), roll=0.5, pitch=0.25)
    check = checker()
    for place in range(len(frame)):
        for bit in (0x01, 0x80):
            changed = bytearray(frame)
            changed[place] ^= bit
            assert not check.accepts(bytes(changed)), place
    assert check.accepts(frame)


def test_a_forged_future_does_not_silence_the_true_sender():
    check, mav = checker(), signer()
    assert check.accepts(packed(mav))
    forged = bytearray(packed(signer()))
    forged[-12:-6] = b"\xff" * 6
    assert not check.accepts(bytes(forged))
    assert check.accepts(packed(mav))
    assert dict(check.rejected) == {"bad_signature": 1}


def test_streams_have_their_own_order():
    check = checker()
    assert check.accepts(packed(signer(unix_s=NOW + 5.0)))
    assert check.accepts(packed(signer(unix_s=NOW + 1.0, link_id=1)))
    assert check.accepts(packed(signer(unix_s=NOW + 2.0, system=8)))
    assert not check.accepts(packed(signer(unix_s=NOW + 2.0)))


def test_a_new_stream_may_be_a_minute_behind_and_no_more():
    assert checker().accepts(packed(signer(unix_s=NOW - 59.0)))
    check = checker()
    assert not check.accepts(packed(signer(unix_s=NOW - 61.0)))
    assert dict(check.rejected) == {"replayed": 1}


def test_stamps_are_ten_microseconds_since_2015_and_never_run_back():
    assert timestamp_at(1_420_070_400.0 + 12.0) == 1_200_000
    assert timestamp_at(0.0) == 0
    mav = signer()
    low, high = struct.unpack("<IH", packed(mav)[-12:-6])
    assert low | high << 32 == timestamp_at(NOW)
    sign_outgoing(mav, KEY, NOW - 1000.0)
    low, high = struct.unpack("<IH", packed(mav)[-12:-6])
    assert low | high << 32 == timestamp_at(NOW) + 1


# -- key files ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize("content", [KEY, KEY.hex().encode(), KEY.hex().upper().encode() + b"\n",
                                     b" ".join(bytes([c]) for c in KEY.hex().encode())])  # fmt: skip
def test_key_files(tmp_path, content):
    (tmp_path / "key").write_bytes(content)
    assert load_key(tmp_path / "key") == KEY


def test_a_raw_key_may_hold_blanks(tmp_path):
    key = b" \n" * 16
    (tmp_path / "key").write_bytes(key)
    assert load_key(tmp_path / "key") == key


@pytest.mark.parametrize("content", [b"", KEY[:31], KEY + b"x", KEY.hex().encode()[:-1], b"z" * 64])
def test_what_is_no_key(tmp_path, content):
    (tmp_path / "key").write_bytes(content)
    with pytest.raises(InputError, match="no signing key; 32 raw bytes or 64 hexadecimal digits") as caught:
        load_key(tmp_path / "key")
    assert "\n" not in str(caught.value)


def test_key_files_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        load_key(tmp_path / "absent")
    with pytest.raises(InputError, match="cannot be read"):
        load_key(tmp_path)
    (tmp_path / "long").write_bytes(bytes(5000))
    with pytest.raises(InputError, match="over 1024 bytes are no signing key"):
        load_key(tmp_path / "long")


def test_keys_of_another_length_are_a_programmers_mistake():
    with pytest.raises(ValueError, match="32 bytes"):
        SignatureCheck(b"short", NOW)
    with pytest.raises(ValueError, match="32 bytes"):
        sign_outgoing(coder(), b"short", NOW)


@pytest.mark.parametrize(("passed_s", "old_s", "taken"), [
    (0.0, 59.0, True), (0.0, 61.0, False), (600.0, 59.0, True), (600.0, 61.0, False), (600.0, 540.0, False)
])  # fmt: skip
def test_the_minute_of_a_new_stream_counts_from_now_and_not_from_when_the_session_began(passed_s, old_s, taken):
    """A recording from after the session's start is old too, once a minute has passed."""
    shown_s = [100.0]
    check = SignatureCheck(KEY, NOW, lambda: shown_s[0])
    shown_s[0] += passed_s
    assert check.accepts(packed(signer(unix_s=NOW + passed_s - old_s))) is taken
    assert check.rejected["replayed"] == (0 if taken else 1)


def test_a_known_stream_may_lag_behind_as_long_as_it_goes_on():
    """A vehicle without GPS time keeps the time that it was given, and is accepted all the same."""
    shown_s = [0.0]
    check, mav = SignatureCheck(KEY, NOW, lambda: shown_s[0]), signer(unix_s=NOW - 30.0)
    assert check.accepts(packed(mav))
    shown_s[0] = 3600.0
    assert check.accepts(packed(mav))


@pytest.mark.parametrize(("mode", "warned"), [(0o600, False), (0o400, False), (0o640, True), (0o604, True)])
def test_a_key_that_others_can_read_is_warned_of_once(tmp_path, capsys, mode, warned):
    path = tmp_path / "key"
    path.write_bytes(KEY)
    path.chmod(mode)
    for _ in range(3):
        assert load_key(path) == KEY
    said = capsys.readouterr()
    assert said.out == ""
    line = f"flownav: {path}: other users can read this signing key; chmod 600 keeps it yours\n"
    assert said.err == (line if warned else "")
