"""Our topics in a copy of the log that was replayed: all of the log's own bytes kept, ours in order among them."""

from __future__ import annotations

import hashlib
import io
import struct

import numpy as np
import pytest
from pyulog import ULog

from flownav.core.errors import InputError
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY, Record
from flownav.export.formats import export
from flownav.export.ulog_topics import (
    SYNC,
    Field,
    Topic,
    data,
    definition,
    header,
    information,
    logged,
    message,
    subscription,
    walk,
)

FLAGS_AT, OFFSETS_AT = 16 + 3, 16 + 3 + 16


def ours(log: bytes, t0: float = 1.0, t1: float = 9.0, rate_hz: float = 7.0) -> Record:
    """A record that says it was replayed from `log`."""
    record = Record({"kind": "replay", "log": "x.ulg", "provenance": {"inputs": {"x.ulg": _digest(log)}}})
    record.manifest["clock_start_s"] = 0.0
    t_s = np.arange(t0, t1, 1.0 / rate_hz)
    poses = {name: np.sin(t_s + k) for k, name in enumerate((*POSITION_NED, *VELOCITY_BODY))}
    record.add("estimate", {"t_s": t_s, **poses, **dict.fromkeys(QUATERNION, np.full(len(t_s), 0.5))})
    record.add("range", {"t_s": t_s, "range_m": 1.0 + 0 * t_s, "quality": 255.0 + 0 * t_s})
    names = np.full(len(t_s), "range", object)
    record.add("innovation", {"t_s": t_s, "sensor": names, "component": names, "innovation": 0.1 * t_s})
    words = {"source": ["gps"], "kind": ["lost"], "detail": [""]}
    record.add("events", {"t_s": t_s[3:4], **{key: np.array(text, object) for key, text in words.items()}})
    return record


def _digest(log: bytes) -> dict[str, str]:
    return {"sha256": hashlib.sha256(log).hexdigest()}


def small_log(gap: bytes = b"", tail: bytes = b"") -> bytes:
    """10 s of two topics at 50 and 5 Hz, one of which does not begin with its time, a parameter and strings."""
    fast_us, slow_us = np.arange(0, 10_000_000, 20_000), np.arange(0, 10_000_000, 200_000)
    fast = Topic("vehicle_fast", fast_us, [Field("float", "a", np.sin(fast_us * 1e-6)),
                                          Field("uint8_t", "b", np.zeros((len(fast_us), 3)))])  # fmt: skip
    rows = data(fast, 4)
    slow = [(t, message("D", struct.pack("<HfQ", 2, 0.5, t))) for t in slow_us.tolist()]
    rows += [logged(t, f"string {t}") for t in range(0, 10_000_000, 3_000_000)]
    body = [*rows, *(type(rows[0])(t, m) for t, m in slow)]
    ordered = [row.body for row in sorted(body, key=lambda row: row.time_us)]
    ordered.insert(len(ordered) // 2, gap)
    return b"".join(
        [
            header(0),
            definition(fast),
            message("F", b"late_stamp:float v;uint64_t timestamp;"),
            information("sys_name", "PX4"),
            message("P", bytes([11]) + b"float A_GAIN" [:11] + struct.pack("<f", 2.5)),
            subscription("vehicle_fast", 4),
            subscription("late_stamp", 2),
            *ordered,
            tail,
        ]
    )  # fmt: skip


def merge(tmp_path, log: bytes, record: Record | None = None):
    (tmp_path / "x.ulg").write_bytes(log)
    written = export(record or ours(log), "ulog", tmp_path / "out.ulg", original=tmp_path / "x.ulg")
    return (tmp_path / "out.ulg").read_bytes(), written


def read(log: bytes) -> ULog:
    return ULog(io.BytesIO(log))


def same_content(before: bytes, after: bytes):
    """Everything that pyulog finds in one log it finds in the other."""
    old, new = read(before), read(after)
    kept = {(topic.name, topic.multi_id): topic for topic in new.data_list}
    for topic in old.data_list:
        for name, values in topic.data.items():
            assert np.array_equal(
                values, kept[topic.name, topic.multi_id].data[name], equal_nan=values.dtype.kind == "f"
            )
    assert old.start_timestamp == new.start_timestamp
    assert old.initial_parameters == new.initial_parameters
    assert [change[1:] for change in old.changed_parameters] == [change[1:] for change in new.changed_parameters]
    assert [d.duration for d in old.dropouts] == [d.duration for d in new.dropouts]
    assert old.msg_info_dict.items() <= new.msg_info_dict.items()
    assert old.msg_info_multiple_dict == new.msg_info_multiple_dict
    strings = [s.message for s in new.logged_messages]
    assert [s.message for s in old.logged_messages] == [s for s in strings if not s.startswith("[flownav]")]
    return {name: topic for (name, _), topic in kept.items() if name.startswith("flownav_")}


def without_ours(before: bytes, after: bytes) -> bytes:
    """The merged log's messages less ours (formats, texts, subscriptions, data, strings)."""
    numbers = {after[m.begin + 4 : m.begin + 6] for m in walk(after, 16, len(after))
               if after[m.begin + 2 : m.begin + 3] == b"A" and b"flownav_" in after[m.begin : m.end]}  # fmt: skip
    kept = [after[:16]]
    for m in walk(after, 16, len(after)):
        whole = after[m.begin : m.end]
        mine = (whole[2:3] in b"FIAL" and b"flownav" in whole) or (whole[2:3] == b"D" and whole[3:5] in numbers)
        kept += [] if mine else [whole]
    return b"".join(kept)


def test_all_of_the_log_is_kept_byte_for_byte_and_ours_are_there(tmp_path):
    log = small_log()
    merged, written = merge(tmp_path, log)
    assert without_ours(log, merged) == log
    found = same_content(log, merged)
    assert set(found) == {"flownav_estimate", "flownav_innovation_range_range"}
    estimate = ours(log).tables["estimate"]
    assert np.array_equal(found["flownav_estimate"].data["x"], estimate["pos_n_m"])
    assert np.array_equal(found["flownav_estimate"].data["timestamp"], np.rint(estimate["t_s"] * 1e6))
    assert not read(merged).file_corruption
    assert written.notes == []


def test_times_are_put_on_the_log_s_clock(tmp_path):
    log = small_log()
    record = ours(log, -1.0, 5.0)
    record.manifest["clock_start_s"] = 3.25
    merged, written = merge(tmp_path, log, record)
    stamps = read(merged).get_dataset("flownav_estimate").data["timestamp"]
    assert np.array_equal(stamps, np.rint((record.tables["estimate"]["t_s"] + 3.25) * 1e6))
    assert written.notes == []


def test_a_record_that_does_not_know_the_log_s_clock_is_refused(tmp_path):
    record = ours(small_log())
    del record.manifest["clock_start_s"]
    with pytest.raises(InputError, match="does not say when its time began there; replay the log again"):
        merge(tmp_path, small_log(), record)


def test_ours_stand_where_their_time_is(tmp_path):
    merged, _ = merge(tmp_path, small_log())
    times = []
    for m in walk(merged, 16, len(merged)):
        number = int.from_bytes(merged[m.begin + 3 : m.begin + 5], "little")
        if m.kind == ord("D") and number != 2:
            times.append(int.from_bytes(merged[m.begin + 5 : m.begin + 13], "little"))
    assert times == sorted(times)


def test_formats_stand_among_the_definitions(tmp_path):
    merged, _ = merge(tmp_path, small_log())
    kinds = [chr(m.kind) for m in walk(merged, 16, len(merged))]
    assert max(k for k, kind in enumerate(kinds) if kind == "F") < kinds.index("A")
    assert kinds[0] == "B"


def test_a_log_that_ends_in_the_middle_of_a_message(tmp_path):
    log = small_log(tail=message("D", struct.pack("<HQ", 4, 10_000_000) + bytes(7))[:-4])
    merged, _ = merge(tmp_path, log, ours(log, 5.0, 14.0))
    found = same_content(log, merged)
    assert len(found["flownav_estimate"].data["x"]) == len(ours(log, 5.0, 14.0).tables["estimate"]["t_s"])
    assert merged.endswith(log[-10:])


def test_damage_is_kept_and_got_over_at_the_next_synchronisation(tmp_path):
    log = small_log(gap=b"\x00\x00\x00rubbish" * 5 + SYNC)
    merged, _ = merge(tmp_path, log)
    found = same_content(log, merged)
    assert len(found["flownav_estimate"].data["x"]) == len(ours(log).tables["estimate"]["t_s"])
    assert b"\x00\x00\x00rubbish" * 5 + SYNC in merged


def test_damage_without_synchronisation_comes_after_all_of_ours(tmp_path):
    log = small_log(gap=b"\xff\xff\x00rubbish" * 5)
    merged, _ = merge(tmp_path, log)
    damaged_from = log.index(b"\xff\xff\x00rubbish")
    assert merged.endswith(log[damaged_from:])
    assert len(same_content(log, merged)["flownav_estimate"].data["x"]) == len(ours(log).tables["estimate"]["t_s"])


def test_offsets_of_appended_data_move_with_it(tmp_path):
    log = bytearray(small_log(tail=b"\x20\x00D\x04"))  # cut in a message, as a crash leaves it
    offset = len(log)
    crash = subscription("vehicle_fast", 5)[:3] + b"\x01" + subscription("vehicle_fast", 5)[4:]
    crash += message("D", struct.pack("<HQf3B", 5, 10_500_000, 4.0, 1, 2, 3))
    log[FLAGS_AT + 8] = 1
    log[OFFSETS_AT : OFFSETS_AT + 8] = struct.pack("<Q", offset)
    whole = bytes(log) + crash
    assert len(read(whole).get_dataset("vehicle_fast", 1).data["a"]) == 1
    merged, _ = merge(tmp_path, whole)
    found = same_content(whole, merged)
    assert len(found["flownav_estimate"].data["x"]) == len(ours(whole).tables["estimate"]["t_s"])
    moved = struct.unpack_from("<3Q", merged, OFFSETS_AT)
    assert moved == (offset + len(merged) - len(whole), 0, 0)
    assert merged[moved[0] :] == crash
    numbers = [merged[m.begin + 4] for m in walk(merged, 16, moved[0]) if m.kind == ord("A")]
    assert sorted(numbers) == [2, 4, 6, 7]  # the crash dump has taken 5


def test_what_lies_before_the_clock_s_zero_is_left_out_and_counted(tmp_path):
    log = small_log()
    record = ours(log, -1.0, 5.0, rate_hz=10.0)
    merged, written = merge(tmp_path, log, record)
    found = same_content(log, merged)
    assert found["flownav_estimate"].data["timestamp"][0] == 0
    assert written.notes == ["rows before time 0 of the log's clock left out: 21"]  # 10 + 10 and an event


@pytest.mark.parametrize(
    ("log", "says"),
    [
        (b"PK not a log at all", "not a ULog file"),
        (header(0)[:16], "holds no message"),
        (header(0), "no data with times"),
        (header(0)[: FLAGS_AT + 8] + b"\x02" + header(0)[FLAGS_AT + 9 :], "newer kind"),
    ],
)
def test_what_cannot_be_merged_into_is_refused(tmp_path, log, says):
    with pytest.raises(InputError, match=says):
        merge(tmp_path, log)
    assert not (tmp_path / "out.ulg").exists()


def test_a_merged_log_is_not_merged_again(tmp_path):
    merged, _ = merge(tmp_path, small_log())
    with pytest.raises(InputError, match="holds flownav_estimate already"):
        merge(tmp_path, merged, ours(merged))


def test_another_clock_is_refused(tmp_path):
    log = small_log()
    with pytest.raises(InputError, match=r"from 0\.0 to 10\.0 s of its clock, the record from 100\.0 to 10"):
        merge(tmp_path, log, ours(log, 100.0, 105.0))


def test_numbers_run_out(tmp_path):
    log = small_log(tail=subscription("vehicle_fast", 65534))
    with pytest.raises(InputError, match="no message numbers are left for 2 more"):
        merge(tmp_path, log)


def test_another_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="was not replayed from this file"):
        merge(tmp_path, small_log(), ours(small_log(gap=SYNC)))
    with pytest.raises(InputError, match="no such file; give the log that was replayed"):
        export(ours(b""), "ulog", tmp_path / "out.ulg", original=tmp_path / "gone.ulg")


@pytest.mark.parametrize(
    "name",
    [
        "ulog/sample_log_small.ulg",
        "ulog/sample_appended_multiple.ulg",
        "px4-voxl-indoor/voxl_two_flow_sensors.ulg",
    ],
)
def test_real_logs_keep_all_they_have(tmp_path, data_folder, name):
    log = (data_folder / name).read_bytes()
    last_s = read(log).last_timestamp * 1e-6
    record = ours(log, last_s - 9.0, last_s + 1.0, rate_hz=50.0)
    merged, _ = merge(tmp_path, log, record)
    found = same_content(log, merged)
    assert np.array_equal(found["flownav_estimate"].data["x"], record.tables["estimate"]["pos_n_m"])
    assert read(merged).file_corruption == read(log).file_corruption
