"""Generator A's flights: what they may be like. Pairs are ranges that a flight draws from evenly."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

Pair = tuple[float, float]


class Traits(NamedTuple):
    """A class of flights; the defaults are a calm flight of a small drone after a long rest.

    rest_s: motors off at first; spin_s: motors on, standing; slip_deg: by how much the spinning-up motors turn the
    vehicle on the floor. flight_s: from lift-off to the start of the descent. kick_m_s: how fast it slides sideways as
    it lifts off. turning: share of legs with a turn.
    accel_lie_m_s2: what vibration shifts the accelerometer's worst axis by in flight. shaking: factor on vibration.
    spikes_hz: how often a gyro reading is a spike. warming_rad_s: what the gyro's bias moves by as it warms up.
    mount_hz: resonance of the IMU's soft mount, 0 without. quantum_rad: what one count of flow is worth.
    askew_deg: how far the flow sensor's axes are turned from the vehicle's. lost: stretches without texture.
    floor: plain, carpet or tiles. boxes: on the floor below the path. table: it starts on one.
    stuck: stretches in which the range repeats itself. baro: a barometer repeated at 950 Hz with a wrong start.
    """

    rest_s: Pair = (6.0, 10.0)
    spin_s: Pair = (0.4, 1.2)
    slip_deg: Pair = (0.0, 0.0)
    flight_s: Pair = (31.0, 39.0)
    height_m: Pair = (0.4, 1.2)
    speed_m_s: Pair = (0.3, 1.1)
    climb_m_s: Pair = (0.25, 0.6)
    sink_m_s: Pair = (0.2, 0.4)
    kick_m_s: Pair = (0.05, 0.25)
    turning: float = 0.0
    turn_rate_rad_s: Pair = (0.2, 0.5)
    wobble_m: Pair = (0.006, 0.018)
    imu_hz: int = 250
    gyro_bias_rad_s: float = 0.0012
    accel_lie_m_s2: Pair = (0.0, 0.0)
    shaking: Pair = (0.6, 1.2)
    spikes_hz: Pair = (0.0, 0.0)
    warming_rad_s: Pair = (0.0, 0.0004)
    mount_hz: Pair = (0.0, 0.0)
    flow_hz: float = 50.0
    quantum_rad: float = 0.002048
    askew_deg: Pair = (0.0, 0.5)
    lost: Pair = (0.0, 0.0)
    floor: str = "plain"
    boxes: Pair = (0.0, 0.0)
    table: bool = False
    range_hz: Pair = (20.0, 40.0)
    outliers: float = 0.002
    stuck: Pair = (0.0, 0.0)
    baro: bool = False


NO_REST = {"rest_s": (0.0, 0.0), "spin_s": (0.15, 0.5)}
CLASSES: dict[str, Traits] = {
    "a-clean": Traits(),
    "a-no-rest": Traits(**NO_REST),
    "a-slip": Traits(rest_s=(0.0, 0.3), spin_s=(0.5, 0.9), slip_deg=(0.4, 2.8)),
    "a-lying": Traits(rest_s=(0.0, 0.0), spin_s=(0.8, 1.6), accel_lie_m_s2=(2.0, 4.0)),
    "a-lying-hard": Traits(**NO_REST, accel_lie_m_s2=(3.0, 4.5), shaking=(1.0, 2.5), flow_hz=20.0),
    "a-vibration": Traits(rest_s=(0.0, 1.5), shaking=(3.0, 4.5), spikes_hz=(0.3, 2.0)),
    "a-counts-100": Traits(flow_hz=100.0),
    "a-flow-8": Traits(flow_hz=8.0),
    "a-flow-20": Traits(flow_hz=20.0, rest_s=(0.0, 3.0)),
    "a-baro": Traits(baro=True, rest_s=(0.5, 2.0)),
    "a-imu-50": Traits(imu_hz=50),
    "a-imu-1000": Traits(imu_hz=1000, rest_s=(0.0, 2.0)),
    "a-yaw": Traits(turning=0.8, turn_rate_rad_s=(1.2, 1.75)),
    "a-table": Traits(table=True, rest_s=(0.5, 4.0)),
    "a-boxes": Traits(boxes=(4.0, 9.0), outliers=0.02, height_m=(0.6, 1.4)),
    "a-texture": Traits(lost=(2.0, 3.9), gyro_bias_rad_s=0.006),
    "a-carpet": Traits(floor="carpet"),
    "a-tiles": Traits(floor="tiles", turning=0.3),
    "a-sticking": Traits(stuck=(2.0, 6.0)),
    "a-temperature": Traits(warming_rad_s=(0.006, 0.018), rest_s=(1.0, 6.0)),
    "a-soft-mount": Traits(mount_hz=(9.0, 22.0), turning=0.4),
    "a-askew": Traits(askew_deg=(3.0, 3.0)),
    "a-high": Traits(height_m=(1.2, 2.2), speed_m_s=(0.4, 1.6), climb_m_s=(0.4, 0.9), sink_m_s=(0.3, 0.6)),
}
MIX = "a-mix"


def traits_of(name: str, random: np.random.Generator) -> Traits:
    """A class's; of the mix, what a flight draws."""
    return mixed(random) if name == MIX else CLASSES[name]


def mixed(random: np.random.Generator) -> Traits:
    """Some of what can go wrong, together; each with a chance of its own."""
    start = [{}, NO_REST, {"rest_s": (0.0, 0.3), "spin_s": (0.5, 0.9), "slip_deg": (0.4, 2.8)}, {"table": True}]
    changes: dict[str, object] = dict(start[random.integers(len(start))])
    changes |= {
        "flow_hz": float(random.choice([8.0, 20.0, 50.0, 100.0], p=[0.15, 0.3, 0.3, 0.25])),
        "imu_hz": int(random.choice([50, 250, 1000], p=[0.2, 0.6, 0.2])),
        "floor": str(random.choice(["plain", "carpet", "tiles"])),
        "quantum_rad": float(random.choice([0.002048, 1.0 / 385.0])),
        "height_m": (0.4, 1.3 if random.random() < 0.7 else 2.0),
    }
    chances: list[tuple[float, dict[str, object]]] = [
        (0.3, {"accel_lie_m_s2": (1.0, 4.0)}),
        (0.25, {"shaking": (2.0, 4.0), "spikes_hz": (0.5, 4.0)}),
        (0.3, {"turning": 0.5, "turn_rate_rad_s": (0.3, 1.6)}),
        (0.3, {"boxes": (2.0, 6.0)}),
        (0.25, {"lost": (1.0, 2.9)}),
        (0.2, {"stuck": (1.0, 4.0)}),
        (0.2, {"baro": True}),
        (0.2, {"mount_hz": (9.0, 22.0)}),
        (0.2, {"askew_deg": (1.0, 3.0)}),
        (0.2, {"warming_rad_s": (0.002, 0.01)}),
        (0.2, {"outliers": 0.02}),
        (0.3, {"gyro_bias_rad_s": 0.006} if changes.get("rest_s") is None else {}),
    ]
    for chance, change in chances:
        if random.random() < chance:
            changes |= change
    return Traits(**changes)  # type: ignore[arg-type]
