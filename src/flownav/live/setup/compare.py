"""A vehicle's parameters compared with those that flownav needs: rows, what blocks arming, and the serial port.

The port in use is found by its baud rate.
"""

from typing import NamedTuple

from flownav.live.setup.knowledge import SETS, Arming, Knowledge, Wanted
from flownav.logs.mavlink.framing import Value

ARDUPILOT_PORTS = range(1, 8)
MAVLINK_PROTOCOLS = (1, 2)
PX4_INSTANCES = range(3)
PX4_PORTS = {101: "TEL1", 102: "TEL2", 103: "TEL3", 104: "TEL4", 6: "URT6", 201: "GPS1", 202: "GPS2"}  # MAV_n_CONFIG
FAST_BAUD = 460_800  # baud at which all that flownav asks for fits
SLOW_LINE = "{} baud carry {} bytes/s each way: rates are reduced to fit (docs/how-to/live.md). Change both ends"
SERIAL_SOURCE = "libraries/AP_SerialManager/AP_SerialManager.cpp (n_PROTOCOL, n_BAUD)"
MAV_SOURCE = "src/modules/mavlink/module.yaml (MAV_${i}_RATE); docs serial_configuration"
EXTERNAL_NAV, GPS_SOURCE = 6, 3  # AP_NavEKF_Source


class Port(NamedTuple):
    """Which ports of the vehicle it may be, and the rows for them."""

    candidates: list[str]
    rows: list[Wanted]


def port_names(family: str) -> list[str]:
    """The parameters that are read from the vehicle to find the port."""
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
    """The ports with MAVLink at our baud rate, and the values wanted for them."""
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
            why=SLOW_LINE.format(baud, baud // 10),
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
        if baud < FAST_BAUD:
            rows.append(
                Wanted(
                    name=f"SER_{port}_BAUD", level="advised", at_least=FAST_BAUD, unit="baud", reboot=True,
                    source=MAV_SOURCE,
                    why=SLOW_LINE.format(baud, baud // 10),
                )
            )  # fmt: skip
    return Port(found, rows)


class Row(NamedTuple):
    """A parameter beside what is wanted.

    status: `right`, `wrong` (must change), `unusual` (works, another value is advised), `shown` (nothing is wanted of
    it), `absent` (must be there), `not there` (need not be). has: None where the vehicle did not answer.
    """

    name: str
    has: float | None
    wanted: str
    status: str
    why: str
    set_to: float | None
    reboot: bool
    source: str


class Block(NamedTuple):
    """Why the vehicle would not arm: a parameter, its value, the make's own words."""

    name: str
    has: float
    says: str
    source: str


def source_set(known: Knowledge, values: dict[str, Value], asked: int | None = None) -> int:
    """The source set for flownav: the one asked for, else one on external navigation, else the first free one."""
    if asked is not None or not known.first_source_set:
        return asked or 0

    def has(n: int, what: str) -> float:
        value = values.get(f"EK3_SRC{n}_{what}")
        return value.number if value else 0.0

    for n in SETS:
        if has(n, "POSXY") == EXTERNAL_NAV:
            return n
    free = [n for n in SETS[1:] if has(n, "POSXY") == 0.0 and has(n, "VELXY") == 0.0]
    return free[0] if free else known.first_source_set


def gps_set(values: dict[str, Value], ours: int) -> int:
    """The first source set beside ours whose position is by GPS; 0 where none is."""
    positions = {n: values.get(f"EK3_SRC{n}_POSXY") for n in SETS if n != ours}
    return next((n for n, value in positions.items() if value is not None and value.number == GPS_SOURCE), 0)


def rows_of(wanted: list[Wanted], values: dict[str, Value]) -> list[Row]:
    """One row for each parameter that matters."""
    return [_any_of(row, values) if row.any_of else _row(row, values) for row in wanted]


def _row(row: Wanted, values: dict[str, Value]) -> Row:
    name = next((n for n in (row.name, *row.alternatives) if n in values), row.name)
    value = values.get(name)
    if value is None:
        status = "absent" if row.level == "must" and not row.optional else "not there"
        return Row(name, None, _words(row), status, row.why, None, row.reboot, row.source)
    fits = row.fits(value.number)
    status = "shown" if row.level == "shown" else "right" if fits else _fault(row)
    set_to = None if fits or row.level == "shown" else row.repaired(value.number)
    return Row(name, value.number, _words(row), status, row.why, set_to, row.reboot, row.source)


def _any_of(row: Wanted, values: dict[str, Value]) -> Row:
    fitting = [name for name in row.any_of if name in values and row.fits(values[name].number)]
    if fitting:
        return Row(fitting[0], values[fitting[0]].number, _words(row), "right", row.why, None, row.reboot, row.source)
    return Row(row.name, None, _words(row), _fault(row), row.why, None, row.reboot, row.source)


def _fault(row: Wanted) -> str:
    return "wrong" if row.level == "must" else "unusual"


def _words(row: Wanted) -> str:
    words_of_row = " ".join(part for part in (row.words(), row.unit) if part)
    return (
        f"{words_of_row} ({row.meaning})" if row.meaning and words_of_row else words_of_row or row.meaning or row.unit
    )


def blocks_of(known: Knowledge, values: dict[str, Value]) -> list[Block]:
    """Blocks to arming that follow from the known rules and the vehicle's values."""

    def words(rule: Arming, name: str) -> str:
        needed = f"; {rule.needs} is {values[rule.needs].number:g}" if rule.needs else ""
        return rule.says.replace("{name}", name) + needed

    return [
        Block(name, values[name].number, words(rule, name), rule.source)
        for rule in known.arming
        for name in known.arming_names(rule)
        if rule.blocks(name, values)
    ]
