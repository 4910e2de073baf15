"""Flights to plant faults in: the simulator's quadrotor, flown by somebody who is not misled, its sensors' streams.

Legs, heights and winds differ with the seed. A flight indoors has no GPS and hardly any wind.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from flownav.campaigns.faults.table import log_of
from flownav.campaigns.local import fly_recorded
from flownav.core.measurement import Sensor
from flownav.core.parameter_files import check, shipped
from flownav.logs.log import Log
from flownav.simulation.assemble import Setup, assemble
from flownav.simulation.scenario import Scenario, load_scenario

ORIGIN_DEG_M = (25.31, 55.49, 20.0)
TAKEOFF_S = 8.0
KINDS = {  # how far from the pad [m], how high [m], how fast [m/s], how long [s], wind [m/s]
    "yard": (10.0, (1.4, 2.8), (0.8, 2.4), 105.0, (1.0, 5.0)),
    "hall": (4.0, (1.0, 2.2), (0.5, 1.6), 85.0, (0.05, 0.3)),
    "climb": (8.0, (1.5, 8.8), (0.6, 1.8), 90.0, (1.0, 4.0)),
    "low": (4.0, (0.18, 1.2), (0.3, 1.2), 85.0, (0.05, 0.3)),
}
SENSOR_EDITS = (  # of the sample's sensor: no scale error, and limits of a sensor that sees as far as its lidar
    ("a_1_s2 = { value = 6600.0, source = \"chosen: gain 0.88\" }", "a_1_s2 = { value = 7500.0, source = \"gain 1\" }"),
    ("max_height_m = 3.5\n", "max_height_m = 12.0\n"),
    ("max_height_m = { value = 3.5, source = \"valid sonar band of the firmware, 0.12 to 3.5 m\" }",
     "max_height_m = { value = 12.0, source = \"as the lidar\" }"),
    ("max_flow_rad_s = { value = 1.6875, source = \"search window of 4.5 px a frame x 250 Hz / 666.67 px\" }",
     "max_flow_rad_s = { value = 7.4, source = \"PMW3901\" }"),
)  # fmt: skip
BARO_EDITS = (  # under foam, away from the propellers: what baro_wash is planted beside
    (
        'wash_share = { value = 0.15, source = "assumed: 0.4 m in a hover" }',
        'wash_share = { value = 0.03, source = "foam" }',
    ),
    ("ground_share = { value = 0.40,", "ground_share = { value = 0.08,"),
    ("wash_spread = { value = 0.4,", "wash_spread = { value = 0.1,"),
    ("drift_sigma_m = { value = 0.5,", "drift_sigma_m = { value = 0.25,"),  # gusts reach the port through the foam
)


def path_of(kind: str, seed: int) -> list[dict[str, float]]:
    """Knots: up, legs with short stops, back and down."""
    rng = np.random.default_rng([seed, sorted(KINDS).index(kind)])
    reach_m, (low_m, high_m), (slow, fast), end_s, _ = KINDS[kind]
    height_m, north_m, east_m, t_s = max(low_m, min(1.6, high_m)), 0.0, 0.0, TAKEOFF_S
    knots = [_knot(0.0), _knot(t_s), _knot(t_s := t_s + max(height_m, 0.6) / 0.8, height_m)]
    knots.append(_knot(t_s := t_s + 2.5, height_m))
    land_s = end_s - 12.0 - (16.0 if kind == "climb" else 0.0)
    while t_s < land_s - 6.0:
        to_north, to_east = rng.uniform(-reach_m, reach_m, 2)
        to_height = _next_height(kind, rng, t_s, low_m, high_m)
        far = max(np.hypot(to_north - north_m, to_east - east_m), 1.4 * abs(to_height - height_m))
        takes_s = max(far / rng.uniform(slow, fast), 2.0)
        if t_s + takes_s > land_s:
            break
        north_m, east_m, height_m, t_s = to_north, to_east, to_height, t_s + takes_s
        knots.append(_knot(t_s, height_m, north_m, east_m))
        if rng.random() < 0.5:
            knots.append(_knot(t_s := t_s + rng.uniform(0.8, 2.5), height_m, north_m, east_m))
    knots.append(_knot(t_s := t_s + max(np.hypot(north_m, east_m) / 1.5, 2.0), height_m))
    down_s = t_s + (height_m - 1.0) / 0.6 if height_m > 1.2 else t_s
    knots += [_knot(down_s, 1.0)] if height_m > 1.2 else []
    left_m = min(height_m, 1.0)
    knots.append(_knot(down_s + (left_m + 8.0) / 0.3, -8.0))
    return knots


def _next_height(kind: str, rng: np.random.Generator, t_s: float, low_m: float, high_m: float) -> float:
    if kind == "climb":  # up in the first half, high in the middle, down again
        share = float(np.interp(t_s, [12.0, 30.0, 58.0, 70.0], [0.0, 1.0, 1.0, 0.1]))
        return low_m + share * (high_m - low_m) * rng.uniform(0.88, 1.0)
    if kind == "low":
        return float(low_m if rng.random() < 0.6 else rng.uniform(0.6, high_m))
    return float(rng.uniform(low_m, high_m))


def _knot(t_s: float, height_m: float = 0.0, north_m: float = 0.0, east_m: float = 0.0) -> dict[str, float]:
    return {"t_s": float(t_s), "height_m": float(height_m), "north_m": float(north_m), "east_m": float(east_m)}


@lru_cache(maxsize=1)
def sheets() -> Path:
    """A folder with the flow sensor and camera, and the lidar, that these flights carry."""
    folder = Path(tempfile.mkdtemp(prefix="planted-"))
    for name in ("flow_camera", "range_sensor", "flow_sensor"):
        text = shipped(f"samples/{name}.toml").read_text(encoding="utf-8")
        for old, new in SENSOR_EDITS if name == "flow_sensor" else ():
            assert old in text, old
            text = text.replace(old, new)
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    text = shipped("sensors/barometer.toml").read_text(encoding="utf-8")
    for old, new in BARO_EDITS:
        assert old in text, old
        text = text.replace(old, new)
    (folder / "barometer.toml").write_text(text, encoding="utf-8")
    return folder


@lru_cache(maxsize=8)
def setup_of(kind: str, seed: int) -> Setup:
    """The scenario of a kind and seed, assembled."""
    entries = load_scenario(str(shipped("samples/flight.toml"))).model_dump(exclude_unset=True)
    rng = np.random.default_rng([seed, 7])
    path = path_of(kind, seed)
    *_, (least, most) = KINDS[kind]
    entries |= {
        "name": f"{kind}-{seed}",
        "description": "to plant faults in",
        "flow_sensor": str(sheets() / "flow_sensor.toml"),
        "sensors": {name: str(sheets() / f"{name}.toml") for name in ("flow_camera", "range_sensor", "barometer")},
        "autopilot": {"feedback": "truth"},
        "flight": {
            "duration_s": KINDS[kind][3] + 5.0, "start": "ground", "takeoff_at_s": TAKEOFF_S,
            "may_land_after_s": path[-2]["t_s"], "path": path,
        },
        "wind": {
            "speed_20ft_m_s": float(rng.uniform(least, most)), "from_direction_deg": float(rng.uniform(0.0, 360.0)),
            "gusts": True,
        },
    }  # fmt: skip
    return assemble(check(entries, Scenario, "planted"))


@lru_cache(maxsize=8)
def flight(kind: str, seed: int) -> Log:
    """The readings of the vehicle's sensors, with the truth, of one flight of an ensemble."""
    setup = setup_of(kind, seed)
    log = replace(log_of(fly_recorded(setup, seed, ensemble=setup.ensemble()), setup), origin_deg_m=ORIGIN_DEG_M)
    if kind not in ("hall", "low"):
        return log
    streams = {s: one for s, one in log.streams.items() if s not in (Sensor.GPS_POSITION, Sensor.GPS_VELOCITY)}
    return replace(log, streams=streams, origin_deg_m=None)
