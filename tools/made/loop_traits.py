"""Generator B's flights: what they may be like. Pairs are ranges that a flight draws from evenly."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

Pair = tuple[float, float]


class Traits(NamedTuple):
    """A class of flights; the defaults are a calm flight of a small drone after a long rest.

    start: floor, table or hand. rest_s: motors off at first; idle_s: motors on, standing; slip_deg: by how much they
    turn the vehicle on the floor. landings: how often it comes down (and goes on). wind_m_s: of the room's air.
    accel_lie_m_s2: what vibration shifts the accelerometer's worst axis by in flight. warming_rad_s: what the gyro's
    bias moves by. mount_hz: resonance of the IMU's soft mount, 0 without. flow: rate (angular rates with a gyro of its
    own) or metric (PX4FLOW's compensated velocity). ranging: laser, or a sonar that says 0.3 m below it. lost:
    stretches without texture. stuck: stretches in which the range repeats itself. gaps: silences of a sensor. baro:
    repeated with the IMU, with a wrong start.
    """

    start: str = "floor"
    rest_s: Pair = (5.0, 8.0)
    idle_s: Pair = (0.4, 1.2)
    slip_deg: Pair = (0.0, 0.0)
    flight_s: Pair = (32.0, 40.0)
    height_m: Pair = (0.5, 1.4)
    speed_m_s: Pair = (0.4, 1.1)
    sink_m_s: Pair = (0.2, 0.4)
    landings: int = 1
    turn_rate_rad_s: Pair = (0.0, 0.0)
    wind_m_s: Pair = (0.03, 0.2)
    imu_hz: int = 250
    gyro_bias_rad_s: float = 0.001
    accel_lie_m_s2: Pair = (0.0, 0.0)
    shaking: Pair = (0.4, 1.2)
    warming_rad_s: Pair = (0.0, 0.0004)
    mount_hz: Pair = (0.0, 0.0)
    flow: str = "rate"
    flow_hz: float = 40.0
    ranging: str = "laser"
    lost: Pair = (0.0, 0.0)
    stuck: Pair = (0.0, 0.0)
    gaps: Pair = (0.0, 0.0)
    baro: bool = False


NO_REST = {"rest_s": (0.0, 0.0), "idle_s": (0.2, 0.5)}
SLIP = {"rest_s": (0.0, 0.2), "idle_s": (0.5, 0.8), "slip_deg": (0.4, 2.8)}
CLASSES: dict[str, Traits] = {
    "b-clean": Traits(),
    "b-no-rest": Traits(**NO_REST),
    "b-slip": Traits(**SLIP),
    "b-lying": Traits(rest_s=(0.0, 0.0), idle_s=(0.6, 1.5), accel_lie_m_s2=(2.0, 4.0)),
    "b-flow-8": Traits(flow_hz=8.0, rest_s=(1.0, 5.0)),
    "b-flow-50": Traits(flow_hz=50.0, rest_s=(0.5, 3.0)),
    "b-baro": Traits(baro=True, rest_s=(1.0, 3.0), imu_hz=1000),
    "b-imu-50": Traits(imu_hz=50),
    "b-yaw": Traits(flight_s=(30.0, 36.0), speed_m_s=(0.6, 1.2), turn_rate_rad_s=(1.2, 1.75)),
    "b-throw": Traits(start="hand", rest_s=(1.5, 4.0), height_m=(0.8, 1.6)),
    "b-table": Traits(start="table", rest_s=(0.5, 3.0)),
    "b-texture": Traits(lost=(2.0, 3.9)),
    "b-sticking": Traits(stuck=(2.0, 6.0), ranging="sonar"),
    "b-dropouts": Traits(gaps=(4.0, 9.0)),
    "b-temperature": Traits(warming_rad_s=(0.006, 0.018), rest_s=(1.0, 6.0)),
    "b-soft-mount": Traits(mount_hz=(9.0, 22.0), wind_m_s=(0.1, 0.3)),
    "b-landings": Traits(landings=3, flight_s=(42.0, 45.0), rest_s=(1.5, 3.5), speed_m_s=(0.8, 1.3)),
    "b-sonar": Traits(ranging="sonar", flow_hz=20.0),
    "b-px4flow": Traits(ranging="sonar", flow="metric", flow_hz=49.0, height_m=(0.8, 2.2)),
    "b-gusts": Traits(wind_m_s=(0.5, 1.0), idle_s=(0.2, 0.6), rest_s=(0.5, 2.0)),
}
MIX = "b-mix"


def traits_of(name: str, random: np.random.Generator) -> Traits:
    """A class's; of the mix, what a flight draws."""
    return mixed(random) if name == MIX else CLASSES[name]


def mixed(random: np.random.Generator) -> Traits:
    """Some of what can go wrong, together; each with a chance of its own."""
    start = [{}, NO_REST, SLIP, {"start": "table"}, {"start": "hand", "rest_s": (1.0, 3.0)}]
    changes: dict[str, object] = dict(start[random.integers(len(start))])
    changes |= {
        "flow_hz": float(random.choice([8.0, 20.0, 50.0])),
        "imu_hz": int(random.choice([50, 250, 1000], p=[0.25, 0.5, 0.25])),
        "ranging": str(random.choice(["laser", "sonar"])),
        "height_m": (0.4, 1.4 if random.random() < 0.7 else 2.0),
    }
    chances: list[tuple[float, dict[str, object]]] = [
        (0.3, {"accel_lie_m_s2": (1.0, 4.0)}),
        (0.25, {"shaking": (2.0, 4.0)}),
        (0.3, {"turn_rate_rad_s": (0.3, 1.6)}),
        (0.25, {"lost": (1.0, 2.9)}),
        (0.2, {"stuck": (1.0, 4.0)}),
        (0.25, {"gaps": (1.0, 4.0)}),
        (0.2, {"baro": True}),
        (0.2, {"mount_hz": (9.0, 22.0)}),
        (0.2, {"warming_rad_s": (0.002, 0.01)}),
        (0.2, {"wind_m_s": (0.3, 0.8)}),
        (0.2, {"landings": 2, "speed_m_s": (0.8, 1.3)}),
    ]
    for chance, change in chances:
        if random.random() < chance:
            changes |= change
    return Traits(**changes)  # type: ignore[arg-type]
