"""Synthetic MAVLink for the tests: messages through real bytes, and small tlogs."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from flownav.logs.mavlink.framing import coder, dialect

START_US = 1_795_211_000_000_000
ARDUPILOT, PX4 = 3, 12


def through_bytes(message: Any) -> Any:
    """The message as the other end sees it."""
    return coder().decode(bytearray(message.pack(coder(7, 1))))


def made(name: str, **fields: Any) -> Any:
    """A decoded message with these fields, the rest 0."""
    kind = getattr(dialect(), f"MAVLink_{name.lower()}_message")
    values = []
    for field_name in kind.fieldnames:
        length = kind.array_lengths[kind.ordered_fieldnames.index(field_name)]
        values.append(fields.pop(field_name, [0] * length if length else 0))
    assert not fields, f"{name} has no {fields}"
    return through_bytes(kind(*values))


@dataclass
class Tlog:
    """Frames with their arrival times; every packer counts its own sequence numbers."""

    frames: list[tuple[int, bytes]] = field(default_factory=list)

    def add(self, arrival_s: float, message: Any, *, system: int = 1, component: int = 1, v1: bool = False) -> None:
        packed = message.pack(coder(system, component), force_mavlink1=v1)
        self.frames.append((START_US + round(arrival_s * 1e6), bytes(packed)))

    @property
    def content(self) -> bytes:
        return b"".join(struct.pack(">Q", arrival) + frame for arrival, frame in self.frames)

    def write(self, path: Path) -> Path:
        path.write_bytes(self.content)
        return path


def flight_log(
    duration_s: float = 4.0, *, autopilot: int = ARDUPILOT, latency_s: Iterable[float] = (0.01,), boot_s: float = 20.0
) -> Tlog:
    """A vehicle that hovers at 2 m, 3 m north and 4 m east of its origin, and rolls slowly; 20 Hz, GPS at 5 Hz."""
    log, latency = Tlog(), list(latency_s)
    log.add(0.0, made("HEARTBEAT", type=4, autopilot=autopilot, base_mode=81, system_status=4, mavlink_version=3))
    log.add(0.0, made("GPS_GLOBAL_ORIGIN", latitude=470000000, longitude=85000000, altitude=400000))
    for step in range(round(duration_s * 20)):
        t = 0.05 * step
        arrival = t + latency[step % len(latency)]
        boot_ms = round((boot_s + t) * 1e3) % 2**32
        roll = 0.05 * math.sin(t)
        log.add(arrival, made("ATTITUDE", time_boot_ms=boot_ms, roll=roll, yaw=0.5, rollspeed=0.05 * math.cos(t)))
        log.add(arrival, made("RAW_IMU", time_usec=boot_ms * 1000, zacc=-1000, xgyro=round(50 * math.cos(t))))
        log.add(arrival, made("LOCAL_POSITION_NED", time_boot_ms=boot_ms, x=3.0, y=4.0, z=-2.0, vx=0.1))
        flow = {"quality": 200, "flow_rate_x": 0.05 * math.cos(t) - 0.02, "flow_rate_y": 0.03}
        log.add(arrival, made("OPTICAL_FLOW", time_usec=boot_ms, flow_comp_m_x=-0.02, flow_comp_m_y=0.03, **flow))
        facing = {"orientation": 25, "min_distance": 10, "max_distance": 4000}
        log.add(arrival, made("DISTANCE_SENSOR", time_boot_ms=boot_ms, current_distance=200, **facing))
        log.add(arrival, made("SIM_STATE", q1=1.0, lat_int=470000000, lon_int=85000000, alt=402.0, vn=0.1))
        if step % 4 == 0:
            fix = {"fix_type": 3, "lat": 470000270, "lon": 85000526, "alt": 402000, "vel": 100, "cog": 9000}
            log.add(arrival, made("GPS_RAW_INT", time_usec=boot_ms * 1000, h_acc=500, v_acc=800, vel_acc=100, **fix))
            log.add(arrival, made("EXTENDED_SYS_STATE", landed_state=2))
    return log


def arbitrary_payload(name: str) -> st.SearchStrategy[bytes]:
    """Any bytes that fill a message, the floats among them often NaN, infinite, huge or tiny."""
    kind = getattr(dialect(), f"MAVLink_{name.lower()}_message")
    special = st.sampled_from([math.nan, math.inf, -math.inf, 3e38, 0.0, -0.0, 1e-40])
    number = st.one_of(special, st.floats(width=32))

    def payload(draw: Any) -> bytes:
        size = kind.unpacker.size
        raw = bytearray(draw(st.binary(min_size=size, max_size=size)))
        for offset in range(0, size - 3, 4):
            if draw(st.booleans()):
                raw[offset : offset + 4] = struct.pack("<f", draw(number))
        return bytes(raw)

    return st.composite(payload)()


def packed_payload(name: str, payload: bytes) -> bytes:
    """A frame of system 1, component 1 with this payload and a right checksum."""
    kind = getattr(dialect(), f"MAVLink_{name.lower()}_message")
    header = struct.pack("<BBBBBBBHB", 0xFD, len(payload), 0, 0, 0, 1, 1, kind.id & 0xFFFF, kind.id >> 16)
    crc = dialect().x25crc(header[1:] + payload + bytes([kind.crc_extra])).crc
    return header + payload + struct.pack("<H", crc)
