"""`flownav live --setup`: meet the vehicle, read, compare, write where asked to, and report what is to be done."""

from dataclasses import dataclass, field
from typing import Any

from flownav.live.link import Address
from flownav.live.reception import Vehicle
from flownav.live.setup.arming import RECEIVERS, Place, Readiness, has_no_gps, readiness
from flownav.live.setup.compare import Block, Row, blocks_of, gps_set, port_names, port_of, rows_of, source_set
from flownav.live.setup.knowledge import Knowledge, knowledge_of
from flownav.live.setup.talk import Change, Talk, read, why_not, write
from flownav.logs.mavlink.framing import Value

NO_GPS_SET = (
    "No source set is on GPS (EK3_SRCn_POSXY 3), so there is none to switch back to: give one of the others GPS as its "
    "source, or take off on set {n} with flownav sending."
)
MEET_S = 10.0  # chosen: ten HEARTBEATs
FITS, FIT = " fits", "'s parameters fit"  # the latter of a vehicle that something else keeps from arming
ENABLING = ("VISO_TYPE", "PLND_ENABLED")  # ArduPilot shows the rest of the group once these are set


@dataclass
class Report:
    """The result of the check. verdict: one sentence; fits: whether nothing must change; refused: why nothing was
    written.
    """

    verdict: str
    fits: bool = False
    make: str = ""
    vehicle: Vehicle | None = None
    armed: bool | None = None
    send: str = ""
    source_set: int = 0
    rows: list[Row] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=list)
    port: str = ""
    changes: list[Change] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    ready: Readiness = field(default_factory=Readiness)
    notes: list[str] = field(default_factory=list)
    in_flight: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "verdict": self.verdict,
            "fits": self.fits,
            "make": self.make,
            "vehicle": self.vehicle._asdict() if self.vehicle else None,
            "armed": self.armed,
            "send": self.send,
            "source_set": self.source_set or None,
            "parameters": [row._asdict() for row in self.rows],
            "blocks_arming": [block._asdict() for block in self.blocks],
            "serial_port": self.port or None,
            "changes": [{**change._asdict(), "done": change.done} for change in self.changes],
            "refused": self.refused,
            "without_gps": self.ready.without_gps,
            "origin_lat_lon_deg_alt_m": self.ready.origin_deg_m,
            "missing": self.ready.missing,
            "autopilot_says": self.ready.says,
            "notes": self.notes,
            "in_flight": self.in_flight,
        }


def check(
    talk: Talk,
    address: Address,
    send: str,
    *,
    writing: bool = False,
    asked_set: int | None = None,
    origin: Place | None = None,
    meet_s: float = MEET_S,
) -> Report:
    """The whole of `--setup` over a conversation. Nothing is written unless `writing`, but an origin that is given."""
    vehicle = talk.meet(meet_s)
    if vehicle is None:
        return Report(_nobody(talk, meet_s), send=send)
    known = knowledge_of(vehicle.make)
    if known is None:
        return Report(
            f"the vehicle is neither ArduPilot nor PX4 (MAV_AUTOPILOT {vehicle.make}): its parameters are not known",
            vehicle=vehicle, armed=talk.armed, send=send,
        )  # fmt: skip
    uart = address.over_uart
    receivers = list(RECEIVERS.get(known.name.lower(), ()))
    values = read(talk, known.names(send) + receivers + (port_names(known.serial_parameters) if uart else []))
    if not values:
        return Report(
            f"the {known.name} vehicle is received but answers no request for a parameter: a router or a signing key "
            "between us may keep our requests from reaching it",
            make=known.name, vehicle=vehicle, armed=talk.armed, send=send,
        )  # fmt: skip
    report = _compared(known, values, send, asked_set, address if uart else None)
    report.vehicle, report.armed = vehicle, talk.armed
    if writing:
        _write(talk, report, values)
        after = _compared(known, values, send, asked_set or report.source_set or None, address if uart else None)
        report.rows, report.blocks, report.fits, report.verdict = after.rows, after.blocks, after.fits, after.verdict
        written = {change.name for change in report.changes if change.done}
        if rebooting := [row.name for row in after.rows if row.reboot and row.name in written]:
            report.notes.insert(
                0, f"Reboot the vehicle, then run this again; read at boot only: {', '.join(rebooting)}."
            )
            report.verdict += "; the vehicle must be rebooted"
    if send in ("odometry", "vision"):
        report.ready = readiness(talk, known.name.lower(), values, origin)
        if report.ready.missing or report.ready.says:
            report.verdict = report.verdict.replace(FITS, FIT) + ("" if report.blocks else "; it cannot arm yet")
            report.fits = False
    return report


def _compared(
    known: Knowledge, values: dict[str, Value], send: str, asked_set: int | None, uart: Address | None
) -> Report:
    without = has_no_gps(known.name.lower(), values)
    chosen = source_set(known, values, asked_set or (1 if without and known.first_source_set else None))
    by_estimate = send in ("odometry", "vision")
    wanted = known.wanted(send, chosen)
    port = ""
    if uart is not None:
        found = port_of(known.serial_parameters, values, uart.number)
        wanted += found.rows
        port = " or ".join(found.candidates) or f"none is set to MAVLink at {uart.number} baud"
    rows, blocks = rows_of(wanted, values), blocks_of(known, values)
    wrong = [row for row in rows if row.status in ("wrong", "absent")]
    fits = not wrong and not blocks
    notes = list(known.notes) if by_estimate else []
    if any(row.name in ENABLING and row.status == "wrong" for row in rows):
        notes.insert(0, f"Absent parameters may appear once {' or '.join(ENABLING)} is set: run this again then.")
    unusual = sum(row.status == "unusual" for row in rows)
    verdict = (
        f"{known.name}{FITS} `--send {send}`" + (f"; {unusual} values are not what is advised" if unusual else "")
        if fits
        else f"{len(wrong)} of {len(rows)} parameters must change{'; arming is blocked' if blocks else ''}"
        if wrong
        else "arming is blocked by the values that are named"
    )
    other = gps_set(values, chosen)
    in_flight = known.in_flight if by_estimate and not without else ()
    if in_flight and chosen and not other:
        in_flight = (NO_GPS_SET,)
    return Report(
        verdict, fits, known.name, send=send, source_set=chosen if by_estimate else 0, rows=rows, blocks=blocks,
        port=port, notes=notes,
        in_flight=[line.replace("{n}", str(chosen)).replace("{g}", str(other)) for line in in_flight],
    )  # fmt: skip


def _write(talk: Talk, report: Report, values: dict[str, Value]) -> None:
    """Set what must change and has a value to set; values are those of the vehicle afterwards."""
    for row in report.rows:
        if row.status == "absent":
            report.refused.append(f"{row.name}: the vehicle does not have it")
        if row.status != "wrong":
            continue
        if row.set_to is None:
            report.refused.append(f"{row.name}: you must choose ({row.wanted})")
            continue
        if refusal := why_not(talk):
            report.refused.append(refusal)
            return
        outcome = write(talk, row.name, values[row.name], row.set_to)
        if isinstance(outcome, str):
            report.refused.append(outcome)
            continue
        report.changes.append(outcome)
        if outcome.after is not None:
            values[row.name] = Value(outcome.after, values[row.name].kind)


def _nobody(talk: Talk, meet_s: float) -> str:
    counts = talk.reception.counts
    counted = ", ".join(f"{name} {count}" for name, count in sorted(counts.items()))
    if counted:
        return (
            f"no autopilot's HEARTBEAT in {meet_s:.0f} s, though something is received ({counted}): "
            "see --system, --component, --signing-key and the baud rate"
        )
    return f"nothing was received in {meet_s:.0f} s: check cable, port and baud rate, and where the vehicle sends to"
