"""The vehicle's own parameters of the serial port that we speak over, found by its baud rate."""

from __future__ import annotations

from typing import NamedTuple

from flownav.live.setup.knowledge import Wanted
from flownav.mavlink.parameters import Value

ARDUPILOT_PORTS = range(1, 8)
MAVLINK_PROTOCOLS = (1, 2)
PX4_INSTANCES = range(3)
PX4_PORTS = {101: "TEL1", 102: "TEL2", 103: "TEL3", 104: "TEL4", 6: "URT6", 201: "GPS1", 202: "GPS2"}  # MAV_n_CONFIG
FAST = 460_800  # baud at which all that flownav asks for fits
SLOW = "{} baud carry {} bytes/s each way: rates are reduced to fit (docs/how-to/live.md). Change both ends"
SERIAL_SOURCE = "libraries/AP_SerialManager/AP_SerialManager.cpp (n_PROTOCOL, n_BAUD)"
MAV_SOURCE = "src/modules/mavlink/module.yaml (MAV_${i}_RATE); docs serial_configuration"


class Port(NamedTuple):
    """Which ports of the vehicle it may be, and the rows for them."""

    candidates: list[str]
    rows: list[Wanted]


def port_names(family: str) -> list[str]:
    """What is asked of the vehicle to find the port."""
    if family == "SERIAL":
        return [f"SERIAL{n}_{what}" for n in ARDUPILOT_PORTS for what in ("PROTOCOL", "BAUD")]
    instances = [f"MAV_{n}_{what}" for n in PX4_INSTANCES for what in ("CONFIG", "MODE", "RATE")]
    return instances + [f"SER_{port}_BAUD" for port in PX4_PORTS.values()]


def baud_of(number: float) -> int:
    """ArduPilot's code for a rate is in thousands, rounded down, except for large ones, which are the rate itself."""
    exact = {1: 1200, 2: 2400, 4: 4800, 9: 9600, 19: 19200, 38: 38400, 57: 57600, 111: 111_100, 115: 115_200,
             230: 230_400, 256: 256_000, 460: 460_800, 500: 500_000, 921: 921_600, 1500: 1_500_000,
             2000: 2_000_000}  # fmt: skip
    return exact.get(int(number), int(number) * 1000 if number < 3000 else int(number))


def port_of(family: str, values: dict[str, Value], baud: int) -> Port:
    """The ports that speak MAVLink at our baud rate, and what is wanted of them."""
    return _serial(values, baud) if family == "SERIAL" else _instances(values, baud)


def _serial(values: dict[str, Value], baud: int) -> Port:
    found = [
        n
        for n in ARDUPILOT_PORTS
        if (protocol := values.get(f"SERIAL{n}_PROTOCOL")) and (rate := values.get(f"SERIAL{n}_BAUD"))
        if protocol.number in MAVLINK_PROTOCOLS and baud_of(rate.number) == baud
    ]
    rows = [
        Wanted(
            name=f"SERIAL{n}_PROTOCOL", level="must", one_of=(2,), set_to=2, meaning="MAVLink 2", reboot=True,
            why="MAVLink 1 leaves out newer fields: GPS accuracy, the flow's rates, the range's quality",
            source=SERIAL_SOURCE,
        )
        for n in found
    ]  # fmt: skip
    rows += [
        Wanted(
            name=f"SERIAL{n}_BAUD", level="advised", one_of=(460, 500, 921, 1500), meaning="460800 baud or faster",
            reboot=True, source=SERIAL_SOURCE,
            why=SLOW.format(baud, baud // 10),
        )
        for n in found
    ]  # fmt: skip
    return Port([f"SERIAL{n}" for n in found], rows)


def _instances(values: dict[str, Value], baud: int) -> Port:
    rows: list[Wanted] = []
    found: list[str] = []
    for n in PX4_INSTANCES:
        port = PX4_PORTS.get(int(config.number)) if (config := values.get(f"MAV_{n}_CONFIG")) else None
        rate = values.get(f"SER_{port}_BAUD")
        if port is None or rate is None or round(rate.number) != baud:
            continue
        found.append(f"MAV_{n} on {port}")
        rows.append(
            Wanted(
                name=f"MAV_{n}_RATE", level="advised", at_least=0.07 * baud, set_to=float(round(0.08 * baud)),
                unit="bytes/s", reboot=True, source=MAV_SOURCE,
                why="0 allows half of the line, and a number its own sum: beyond it PX4 slows every stream down",
            )
        )  # fmt: skip
        if baud < FAST:
            rows.append(
                Wanted(
                    name=f"SER_{port}_BAUD", level="advised", at_least=FAST, unit="baud", reboot=True,
                    source=MAV_SOURCE,
                    why=SLOW.format(baud, baud // 10),
                )
            )  # fmt: skip
    return Port(found, rows)
