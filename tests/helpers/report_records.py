"""Records for the report's tests: a plausible landing, a take-off and a replay, without flying them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from flownav.core.record import Record
from flownav.report.comparison import write_records
from flownav.report.html import write_report
from flownav.studies.compare.records import HEADINGS, cells, errors_in_time, rows_of_records

PAPER_LANDING = {
    "title": "Table 6",
    "states": {
        "x": {"mean_error": 0.0133, "std_error": 0.0750},
        "y": {"mean_error": 0.0165, "std_error": 0.1380},
        "z": {"mean_error": 0.0401, "std_error": 0.1994},
        "u": {"mean_error": 0.0016, "std_error": 0.0470},
        "v": {"mean_error": 0.0069, "std_error": 0.0446},
        "w": {"mean_error": 0.0117, "std_error": 0.2939},
    },
    "max_position_error_m": 0.2723,
}
STATES = ("x", "y", "z", "u", "v", "w")
POSITION = ("pos_n_m", "pos_e_m", "pos_d_m")
VELOCITY = ("vel_u_m_s", "vel_v_m_s", "vel_w_m_s")


def _markov(random: np.random.Generator, count: int, sigma: float, tau_s: float, dt_s: float) -> np.ndarray:
    """First-order Gauss-Markov noise, shape (count, 3)."""
    keep = np.exp(-dt_s / tau_s)
    drive = random.normal(0.0, sigma * np.sqrt(1 - keep * keep), (count, 3))
    noise = np.zeros((count, 3))
    for row in range(1, count):
        noise[row] = keep * noise[row - 1] + drive[row]
    return noise


def _quaternion(roll: np.ndarray, pitch: np.ndarray) -> dict[str, np.ndarray]:
    return {"qw": np.cos(roll / 2) * np.cos(pitch / 2), "qx": np.sin(roll / 2) * np.cos(pitch / 2),
            "qy": np.cos(roll / 2) * np.sin(pitch / 2), "qz": -np.sin(roll / 2) * np.sin(pitch / 2)}  # fmt: skip


def flight(scenario: str = "landing", seed: int = 1, gps_sigma_m: float = 0.3) -> Record:
    """50 s at 50 Hz: 3 m down at 0.3 m/s from 10 s on (landing), or 3 m up at 1 m/s (takeoff)."""
    random, dt_s = np.random.default_rng(seed), 0.02
    t_s = np.arange(0.0, 50.0, dt_s)
    height = np.clip(3.0 - 0.3 * (t_s - 10.0) if scenario == "landing" else t_s - 10.0, 0.0, 3.0)
    smooth = np.ones(25) / 25
    height = np.convolve(np.pad(height, 12, mode="edge"), smooth, mode="valid")
    airborne = np.clip(height, 0.0, 0.3) / 0.3
    position = np.column_stack([0.10 * np.sin(0.5 * t_s) * airborne, 0.14 * np.cos(0.37 * t_s) * airborne, -height])
    velocity = np.gradient(position, dt_s, axis=0)
    roll, pitch = np.radians(5.7) * airborne + 0.01 * np.sin(0.9 * t_s), 0.01 * np.cos(0.7 * t_s)
    on_ground = height < 1e-3
    thrust = 107.0 * airborne * (1 + 0.01 * random.normal(size=len(t_s)))

    position_error = _markov(random, len(t_s), 0.07, 0.6, dt_s)
    velocity_error = _markov(random, len(t_s), 0.03, 0.3, dt_s)
    if scenario == "takeoff":
        since = t_s - t_s[np.flatnonzero(~on_ground)[0]]
        velocity_error[:, 2] += np.where(since > 0, 0.5 * np.exp(-np.maximum(since, 0) / 0.4) * np.sin(9 * since), 0)
    estimate, speed = position + position_error, velocity + velocity_error
    gps = position + random.normal(0.0, gps_sigma_m, position.shape)
    engaged = (height < 2.2) & (height > 0.02)
    flow = velocity + random.normal(0.0, 0.05, velocity.shape)
    flow[:, 2] = np.nan

    record = Record()
    attitude = _quaternion(roll, pitch)
    record.add("truth", {"t_s": t_s, **dict(zip(POSITION, position.T, strict=True)),
                         **dict(zip(VELOCITY, velocity.T, strict=True)), **attitude,
                         "thrust_n": thrust, "on_ground": on_ground})  # fmt: skip
    sigma = {f"std_{name}": np.full(len(t_s), 0.07) for name in POSITION}
    sigma |= {f"std_{name}": np.full(len(t_s), 0.03) for name in VELOCITY}
    record.add("estimate", {"t_s": t_s, **dict(zip(POSITION, estimate.T, strict=True)),
                            **dict(zip(VELOCITY, speed.T, strict=True)), **attitude, **sigma})  # fmt: skip
    record.add("command", {"t_s": t_s, "pos_n_ref_m": 0 * t_s, "pos_e_ref_m": 0 * t_s, "pos_d_ref_m": -height,
                           "lon_rad": 0.01 * np.sin(t_s), "lat_rad": 0.01 * np.cos(t_s),
                           "col_rad": 0.0733 * airborne, "ped_rad": 0.08 * airborne})  # fmt: skip
    record.add("gps_position", {"t_s": t_s, **dict(zip(POSITION, gps.T, strict=True)), "quality": 255.0 + 0 * t_s})
    record.add("flow_velocity", {"t_s": t_s, **dict(zip(VELOCITY, flow.T, strict=True)),
                                 "quality": np.where(engaged, 220.0, 0.0)})  # fmt: skip
    record.add("innovation", _innovations(t_s, gps - estimate, (flow - speed)[:, :2], engaged, gps_sigma_m))
    edges = np.flatnonzero(np.diff(engaged.astype(int))) + 1
    touched = scenario == "landing"
    times = [*t_s[edges], *([float(t_s[np.flatnonzero(on_ground)[0]])] if touched else [])]
    kinds = [*("engaged" if engaged[row] else "disengaged" for row in edges), *(["touchdown"] if touched else [])]
    record.add("events", {"t_s": np.array(times), "source": np.array(["flow"] * len(edges) + ["vehicle"] * touched),
                          "kind": np.array(kinds), "detail": np.array(["height above ground [m]"] * len(times)),
                          "value": np.full(len(times), np.nan)})  # fmt: skip
    record.manifest = _manifest(scenario, seed, estimate - position, speed - velocity, times[-1] if touched else None)
    return record


def navigated(seed: int = 1) -> Record:
    """The landing on the navigator: its estimate of other instants than the truth's, 2 m off, and the estimate used
    by the autopilot.
    """
    record = flight("landing", seed)
    truth, estimate = record.tables["truth"], record.tables.pop("estimate")
    t_s = 0.06 + np.cumsum(np.random.default_rng(seed).uniform(0.02, 0.03, 1900))
    moved = {name: np.interp(t_s, truth["t_s"], truth[name]) + 2.0 * (name == "pos_n_m") for name in POSITION}
    rest = {name: np.interp(t_s, estimate["t_s"], column) for name, column in estimate.items() if name not in POSITION}
    record.add("estimate", {**rest, "t_s": t_s, **moved})
    handed = truth["t_s"] >= 5.0
    flown = {name: np.where(handed, estimate[name], truth[name]) for name in (*POSITION, *VELOCITY)}
    flown["pos_e_m"] = flown["pos_e_m"] + np.where(truth["t_s"] > 15.0, 1.0, 0.0)  # as a pad is found
    attitude = {name: truth[name] for name in ("qw", "qx", "qy", "qz")}
    record.add("flown", {"t_s": truth["t_s"], **flown, **attitude})
    record.manifest |= {
        "filter": "landing",
        "known_exactly": "its position in hover for the first 5 s (true state used)",
    }
    return record


def _innovations(
    t_s: np.ndarray, gps: np.ndarray, flow: np.ndarray, engaged: np.ndarray, gps_sigma_m: float
) -> dict[str, np.ndarray]:
    rows = []
    for sensor, residual, names, sigma, when in (
        ("gps_position", gps, POSITION, np.hypot(gps_sigma_m, 0.07), np.full(len(t_s), True)),
        ("flow_velocity", flow, VELOCITY[:2], np.hypot(0.05, 0.03), engaged),
    ):
        for column, name in enumerate(names):
            value = residual[when, column]
            ratio = value**2 / (9 * sigma**2)
            rows.append((t_s[when], np.full(len(value), sensor), np.full(len(value), name), value,
                         np.full(len(value), sigma**2), ratio, ratio < 1.0))  # fmt: skip
    columns = [np.concatenate(parts) for parts in zip(*rows, strict=True)]
    names = ("t_s", "sensor", "component", "innovation", "innovation_variance", "test_ratio", "fused")
    table = dict(zip(names, columns, strict=True))
    table["observation_variance"] = table["innovation_variance"] * 0.9
    table["reason"] = np.where(table["fused"], "", "outside the gate")
    return table


def _touchdown(t_s: float) -> dict[str, Any]:
    """A landing as `scoring.landings.touchdown_of_flight` has it."""
    return {
        "contact": {"t_s": t_s, "north_m": 0.05, "east_m": 0.0663, "distance_m": 0.083, "sink_rate_m_s": 0.294,
                    "lateral_speed_m_s": 0.05, "tilt_deg": 5.6, "yaw_rate_deg_s": 1.2},
        "rest": {"t_s": t_s + 0.8, "north_m": 0.05, "east_m": 0.091, "distance_m": 0.104, "tilt_deg": 0.2,
                 "slide_m": 0.025},
        "limited_by": {"estimate_m": 0.012, "guidance_m": 0.081, "pad_m": 0.003},
        "success": True, "broken": [],
    }  # fmt: skip


def _manifest(
    scenario: str, seed: int, position_error: np.ndarray, velocity_error: np.ndarray, touchdown_s: float | None
) -> dict[str, Any]:
    errors = np.column_stack([position_error, velocity_error]).T
    return {
        "kind": "fly", "scenario": scenario, "filter": "paper", "gps": "white", "seed": seed, "duration_s": 50.0,
        "pad_size_m": 1.0,
        "command": ["flownav", "fly", scenario, "--seed", str(seed)],
        "paper": PAPER_LANDING,
        "parameters": {
            "step_s": 0.002,
            "vehicle": {"name": "Maxi Joker 3", "mass_kg": 8.0, "rotor": {"radius_m": 0.9, "speed_rad_s": 146.6}},
            "flow": {"a": 196.9, "b": 14.8, "c": 191.9, "rate_hz": 250.0},
            "filter": {"q_diagonal": [0.0022] * 3 + [0.01] * 3},
        },
        "provenance": {
            "versions": {"flownav": "0.1.0", "numpy": np.__version__},
            "inputs": {"maxi_joker_3.toml": "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08"},
        },
        "scores": {
            "states": {name: {"mean_error": float(e.mean()), "std_error": float(e.std()),
                              "rms_error": float(np.sqrt((e * e).mean())), "max_error": float(np.abs(e).max())}
                       for name, e in zip(STATES, errors, strict=True)},
            "max_position_error_m": float(np.abs(position_error).max()),
            "touchdown": None if touchdown_s is None else
                         _touchdown(touchdown_s),
        },
    }  # fmt: skip


def replay(duration_s: float = 849.0, seed: int = 2, autopilot: bool = True, flow: bool = True) -> Record:
    """Laps at 3 m without truth, as an outdoor log replayed: 57 Hz estimate, 5 Hz GPS, 9.5 Hz flow, one GPS outage."""
    random, dt_s = np.random.default_rng(seed), 1.0 / 57.0
    t_s = np.arange(0.0, duration_s, dt_s)
    angle = 2 * np.pi * t_s / 60.0
    height = 3.0 * np.clip(t_s / 5.0, 0, 1) * np.clip((duration_s - t_s) / 5.0, 0, 1)
    path = np.column_stack([25 * np.sin(angle), 18 * np.sin(2 * angle), -height])
    earth = np.gradient(path, dt_s, axis=0)
    heading = np.unwrap(np.arctan2(earth[:, 1], earth[:, 0]))
    body = np.column_stack([np.hypot(earth[:, 0], earth[:, 1]), 0 * t_s, earth[:, 2]])
    attitude = {"qw": np.cos(heading / 2), "qx": 0 * t_s, "qy": 0 * t_s, "qz": np.sin(heading / 2)}
    window = (0.3 * duration_s, 0.3 * duration_s + min(60.0, duration_s / 5))
    drift = np.where((t_s > window[0]) & (t_s < window[1]), 1.2 * (t_s - window[0]) / (window[1] - window[0]), 0.0)
    estimate = path + _markov(random, len(t_s), 0.15, 5.0, dt_s) + drift[:, None] * np.array([1.0, 0.6, 0.0])
    record = Record()
    std = {f"std_{name}": 0.2 + drift for name in POSITION}
    std |= {f"std_{name}": np.full(len(t_s), 0.1) for name in VELOCITY}
    noisy = body + random.normal(0, 0.05, body.shape)
    record.add("estimate", {"t_s": t_s, **dict(zip(POSITION, estimate.T, strict=True)),
                            **dict(zip(VELOCITY, noisy.T, strict=True)), **attitude, **std})  # fmt: skip
    if autopilot:
        other = path + _markov(random, len(t_s), 0.4, 8.0, dt_s)
        record.add("autopilot", {"t_s": t_s, **dict(zip(POSITION, other.T, strict=True)),
                                 **dict(zip(VELOCITY, noisy.T, strict=True)), **attitude})  # fmt: skip
    slow = slice(None, None, 11)
    gps = path[slow] + random.normal(0, 0.4, path[slow].shape)
    speed = earth[slow] + random.normal(0, 0.1, path[slow].shape)
    arrival = t_s[slow] + 0.22
    good = 255.0 + 0.0 * arrival
    record.add("gps_position", {"t_s": arrival, **dict(zip(POSITION, gps.T, strict=True)), "quality": good})
    names = ("vel_n_m_s", "vel_e_m_s", "vel_d_m_s")
    record.add("gps_velocity", {"t_s": arrival, **dict(zip(names, speed.T, strict=True)), "quality": good})
    record.add("range", {"t_s": t_s, "range_m": np.maximum(height, 0.13), "quality": 255 + 0 * t_s})
    record.add("attitude", {"t_s": t_s, **attitude, "quality": 255 + 0 * t_s})
    if flow:
        some = slice(None, None, 6)
        distance = np.maximum(height[some], 0.13)
        gyro = random.normal(0, 0.05, (len(distance), 2))
        gap = (t_s[some] > 0.5 * duration_s) & (t_s[some] < 0.6 * duration_s)
        record.add("flow_rate", {"t_s": t_s[some], "flow_x_rad_s": gyro[:, 0] - body[some, 1] / distance,
                                 "flow_y_rad_s": gyro[:, 1] + body[some, 0] / distance, "gyro_x_rad_s": gyro[:, 0],
                                 "gyro_y_rad_s": gyro[:, 1], "quality": np.where(gap, 0.0, 180.0)})  # fmt: skip
    fused = (arrival < window[0]) | (arrival > window[1])
    residual = gps - estimate[slow]
    parts = {"t_s": np.tile(arrival, 3), "sensor": np.repeat("gps_position", 3 * len(arrival)),
             "component": np.repeat(POSITION, len(arrival)), "innovation": residual.T.ravel(),
             "observation_variance": np.full(3 * len(arrival), 0.25),
             "innovation_variance": np.full(3 * len(arrival), 0.3),
             "test_ratio": residual.T.ravel() ** 2 / 2.7, "fused": np.tile(fused, 3)}  # fmt: skip
    record.add("innovation", parts)
    record.manifest = {
        "kind": "replay", "log": "quad-px4flow-outdoor", "filter": "landing", "duration_s": duration_s,
        "delays_s": {"gps_position": 0.22, "gps_velocity": 0.22},
        "parameters": {"gps_outages_s": [list(window)]},
        "scores": {
            "outages": [
                {"t0": window[0], "t1": window[1], "horizontal_rms_m": 0.87, "horizontal_max_m": 1.63},
                {"t0": 1.0, "t1": 3.0, "horizontal_rms_m": 0.41, "horizontal_max_m": 0.72},
            ],
            "outage_median_rms_m": 0.64,
            "velocity_rms_m_s": 0.23,
            "rejected": {"flow_rate": {"no_data": 812, "innovation_gate": 31}, "gps_position": {"outage": 300}},
            "readings": {
                "flow_rate": {
                    "offered": 5000, "fused": 4571, "in_part": 23, "rejected": {"no_data": 406, "innovation_gate": 27}
                },
            },
        },
    }  # fmt: skip
    return record


def write_pages(folder: Path, records: Mapping[str, Record]) -> dict[str, Path]:
    """The pages of the records, and one that compares two flights (`compared`), in a folder, by name."""
    for name, record in records.items():
        write_report(record, folder / f"{name}.html")
    named = [("a", flight()), ("b", flight(seed=2))]
    errors = [errors_in_time(record) for _, record in named]
    rows = [cells(row) for row in rows_of_records(named)]
    write_records(named, errors, HEADINGS, rows, folder / "compared.html")
    return {path.stem: path for path in folder.iterdir()}
