"""Records for the tests of export: a hand-made one with every awkward thing in it, and truth without attitude."""

from __future__ import annotations

import numpy as np

from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY, Record


def awkward() -> Record:
    """Times before zero and out of order, NaN rows, an empty table, text with commas, quotes and line ends."""
    random = np.random.default_rng(5)
    count = 40
    t_s = np.arange(count) * 0.05 - 0.22
    t_s[[7, 8]] = t_s[[8, 7]]
    quaternion = random.normal(size=(count, 4))
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    position = random.normal(size=(count, 3))
    position[3, 1] = np.nan
    record = Record({"kind": "replay", "log": "awkward", "provenance": {"inputs": {}}, "scores": {"rms": 0.1}})
    poses = {"t_s": t_s, **dict(zip(POSITION_NED, position.T, strict=True))}
    velocity = dict(zip(VELOCITY_BODY, random.normal(size=(3, count)), strict=True))
    std = {f"std_{name}": random.uniform(0.1, 0.2, count) for name in (*POSITION_NED, *VELOCITY_BODY)}
    attitude = dict(zip(QUATERNION, quaternion.T, strict=True))
    record.add("estimate", {**poses, **velocity, **attitude, **std})
    record.add("truth", {"t_s": t_s, **dict(zip(POSITION_NED, random.normal(size=(3, count)), strict=True))})
    record.add("flow_rate", {"t_s": t_s[:0], **{f"{what}_{axis}_rad_s": t_s[:0] for what in ("flow", "gyro")
                                                for axis in "xy"}, "quality": t_s[:0]})  # fmt: skip
    record.add(
        "range", {"t_s": t_s, "range_m": np.where(np.arange(count) % 9, 1.5, np.nan), "quality": 255.0 + 0 * t_s}
    )
    record.add("innovation", {
        "t_s": np.repeat(np.sort(t_s), 2),
        "sensor": np.tile(np.array(["gps_position", "range"], object), count),
        "component": np.tile(np.array(["pos_n_m", "pos_d_m"], object), count),
        "innovation": random.normal(size=2 * count),
        "test_ratio": np.full(2 * count, np.nan),
        "fused": np.arange(2 * count) % 3 > 0,
        "reason": np.where(np.arange(2 * count) % 3 > 0, "fused", "innovation_gate").astype(object),
    })  # fmt: skip
    record.add("events", {
        "t_s": np.array([-0.2, 0.5, 0.7]),
        "source": np.array(["replay", "gps", "gps"], object),
        "kind": np.array(["warning", "lost", "back"], object),
        "detail": np.array(['a "quoted", comma\nand a second line', "for this long [s]", ""], object),
        "value": np.array([np.nan, 0.2, np.inf]),
    })  # fmt: skip
    record.add("flags", {"t_s": t_s, "mode": np.array(["a", "b"] * (count // 2), object), "level": np.arange(count)})
    return record
