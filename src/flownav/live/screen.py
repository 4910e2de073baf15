"""The live screen: what arrives and how old it is, what the filter makes of it, the estimate, how full the link is."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from flownav.core.measurement import COLUMNS, Sensor
from flownav.estimation.gating import Reason
from flownav.estimation.hypotheses import NAMES
from flownav.live.answers import WITHHELD
from flownav.live.display import View
from flownav.live.link import Link
from flownav.live.loop import Latency
from flownav.live.session import Session
from flownav.logs.mavlink.converted import OPTIONAL
from flownav.navigation.memory import PROTECTION, SUSPECTED

if TYPE_CHECKING:
    from flownav.live.recorder import Recorder

STRIP = 60  # columns of a strip of signals
BARS = "▁▂▃▄▅▆▇█"
SHOWN = {
    Sensor.FLOW_RATE: (0, 1), Sensor.FLOW_VELOCITY: (0, 1), Sensor.RANGE: (0,), Sensor.IMU: (5,),
}  # fmt: skip


class Traffic:
    """Bytes between one look and the next."""

    def __init__(self, link: Link, session: Session, now_s: float) -> None:
        self._link, self._session = link, session
        self._received, self._written, self._at_s = link.received, link.written, now_s

    def look(self, now_s: float) -> dict[str, Any]:
        """Since the last look."""
        link, elapsed_s = self._link, now_s - self._at_s
        received, written = link.received - self._received, link.written - self._written
        self._received, self._written, self._at_s = link.received, link.written, now_s
        return traffic_facts(link, self._session, elapsed_s, received, written)


def traffic_facts(
    link: Link, session: Session, duration_s: float, received: int | None = None, written: int | None = None
) -> dict[str, Any]:
    """Rates asked for, bytes each way and their share of the line, and what was not sent.

    received, written: bytes in the duration; the link's own where they are not given. Counts are the session's.
    """
    plan, capacity = session.rates.plan, link.capacity_bytes_s
    seconds = max(duration_s, 1e-6)
    received_bytes_s = (link.received if received is None else received) / seconds
    written_bytes_s = (link.written if written is None else written) / seconds
    return {
        "capacity_bytes_s": capacity,
        "received_bytes_s": received_bytes_s,
        "written_bytes_s": written_bytes_s,
        "received_share": received_bytes_s / capacity if capacity else None,
        "written_share": written_bytes_s / capacity if capacity else None,
        "asked_hz": {name: rate_hz for name, (_, rate_hz) in plan.streams.items()},
        "asked_bytes_s": plan.bytes_s,
        "too_slow_for": plan.lacks,
        "estimate_hz_at_most": plan.estimate_hz if plan.estimate_hz < float("inf") else None,
        "estimates_replaced": link.counts["replaced"],
        "flow_without_own_estimate": session.intake.flow_waited,
        "frames_not_sent": link.counts["not_sent"],
        "datagrams_lost": link.counts["overflowed"],
        "slow_reader": session.backlog.spells if session.backlog is not None else 0,
    }


def in_words(facts: Mapping[str, Any]) -> str:
    """One line of `traffic_facts`: what came and went, of what the link carries, and what was not sent."""

    def one(bytes_s: float, share: float | None) -> str:
        return f"{bytes_s / 1e3:.1f} kB/s" + ("" if share is None else f" ({100.0 * share:.0f} %)")

    received, written = (one(facts[f"{way}_bytes_s"], facts[f"{way}_share"]) for way in ("received", "written"))
    parts = [f"Link: in {received}, out {written}"]
    at_most = facts["estimate_hz_at_most"]
    parts += [f"at most {at_most:.0f} estimates/s"] if at_most is not None else []
    parts += [f"TOO SLOW for {facts['too_slow_for']}"] if facts["too_slow_for"] else []
    replaced, not_sent = facts["estimates_replaced"], facts["frames_not_sent"]
    parts += [f"not sent: {replaced} old estimates, {not_sent} other frames"] if replaced or not_sent else []
    lost = facts["datagrams_lost"]
    parts += [f"LOST {lost} datagrams: more came than could be read"] if lost else []
    parts += ["the reader is SLOW, and was sent fewer estimates"] if facts["slow_reader"] else []
    return "; ".join(parts)


class Screen:
    """Keeps what the strips show; `view` looks at the session, at once; drawing it is somebody else's (display.py)."""

    def __init__(
        self,
        session: Session,
        latency: Latency,
        url: str,
        recorder: Recorder | None = None,
        scheduling: str = "",
        link: Link | None = None,
    ) -> None:
        self._session, self._latency, self._url, self._link = session, latency, url, link
        self._recorder, self._scheduling = recorder, scheduling
        self._traffic: Traffic | None = None
        self._traffic_s, self._words = float("-inf"), ""
        self._strips: dict[str, deque[float]] = {}
        self._before: dict[Sensor, int] = {}
        self._at_s = float("nan")
        self._rates: dict[Sensor, float] = {}

    def view(self, now_s: float) -> View:
        """The screen's content at an instant of our clock."""
        session = self._session
        self._follow(now_s)
        dropped = ", ".join(f"{name} {count}" for name, count in sorted(session.dropped.items())) or "nothing"
        return View(
            self._title(),
            self._alarms(),
            [self._sensor(sensor, now_s) for sensor in sorted(session.intake.readings)],
            self._estimate(),
            [(name, strip(values), _figure(values[-1])) for name, values in self._strips.items()],
            [self._protection(), f"dropped: {dropped}", self._line(now_s), self._footing(), self._running()],
        )

    def _sensor(self, sensor: Sensor, now_s: float) -> tuple[str, ...]:
        session = self._session
        keys = [key for key in sorted(session.innovations) if key[0] == sensor and is_shown(session, key)]
        found = [session.innovations[key] for key in keys]
        return (
            sensor.name.lower(),
            f"{self._rates.get(sensor, 0.0):.0f}",
            f"{now_s - session.intake.received_s[sensor]:.2f}",
            f"{session.intake.lags.by_sensor.get(sensor, 0.0):.2f}",
            " ".join(_figure(innovation) for innovation, _, _ in found),
            " ".join(_figure(ratio) for _, ratio, _ in found),
            " ".join(dict.fromkeys(Reason(reason).label for _, _, reason in found if reason)),
        )

    def _line(self, now_s: float) -> str:
        """How full the link was in the last second, and what it keeps from being sent."""
        if self._link is None:
            return ""
        if self._traffic is None:
            self._traffic, self._traffic_s = Traffic(self._link, self._session, now_s), now_s
        if now_s - self._traffic_s >= 1.0:
            self._words, self._traffic_s = in_words(self._traffic.look(now_s)), now_s
        return self._words

    def _title(self) -> str:
        vehicle = self._session.reception.vehicle
        who = f"system {vehicle.system}, component {vehicle.component}" if vehicle else "no vehicle yet"
        state = f"withheld: {WITHHELD[self._session.reason]}" if self._session.reason else "sending"
        return f"{self._url}  {who}  {state}"

    def _alarms(self) -> list[str]:
        """Alarms: sensors that are received and not fused, and a record that is not written."""
        reason = self._recorder.reason if self._recorder is not None else ""
        unfused = [
            f"ALARM: {sensor.name.lower()} is received and has not been fused for "
            f"{spell.until_s - spell.since_s:.0f} s ({spell.why})"
            for sensor, spell in sorted(self._session.alarms.items())
        ]
        return [*unfused, *([f"NOT RECORDING: {reason}"] if reason else [])]

    def _running(self) -> str:
        """The line about the recording, and about the scheduling of the process."""
        recorder = self._recorder
        kept = "not asked for" if recorder is None else f"{recorder.path}, {1e-6 * recorder.size:.1f} MB"
        return f"recording: {kept}" + (f"; scheduling: {self._scheduling}" if self._scheduling else "")

    def _estimate(self) -> list[tuple[str, ...]]:
        found = self._session.estimate
        if found is None or found.pose_covariance is None or found.velocity_covariance is None:
            return []
        rows = []
        for name, values, covariance in (
            ("position [m]", found.pos_ned_m, found.pose_covariance),
            ("velocity [m/s]", found.vel_ned_m_s, found.velocity_covariance),
        ):
            spread = [3.0 * math.sqrt(max(float(covariance[i, i]), 0.0)) for i in range(3)]
            rows.append((name, *(f"{value:8.2f} ±{s:.2f}" for value, s in zip(values, spread, strict=True))))
        return rows

    def _protection(self) -> str:
        """How far off the position may be, and which fault is suspected."""
        found = protection_of(self._session)
        if found is None:
            return "protection levels: none yet"
        horizontal_m, vertical_m, suspected = found
        doubt = f"; suspected: {suspected}" if suspected else ""
        return f"protection levels: {horizontal_m:.2f} m horizontal, {vertical_m:.2f} m vertical{doubt}"

    def _footing(self) -> str:
        session = self._session
        p50, p99 = (1e3 * self._latency.quantile_s(share) for share in (0.5, 0.99))
        withheld = ", ".join(f"{name} {count}" for name, count in sorted(session.withheld.items()))
        refused = ", ".join(session.requests.refused)
        return (
            f"horizon {session.intake.horizon_s:.2f} s; sent {session.sent}; "
            f"withheld: {withheld or 'none'}; resets {session.resets}; "
            f"latency p50 {p50:.2f} ms, p99 {p99:.2f} ms" + (f"; vehicle refuses {refused}" if refused else "")
        )

    def _follow(self, now_s: float) -> None:
        session, elapsed_s = self._session, now_s - self._at_s
        for sensor, count in session.intake.readings.items():
            if elapsed_s > 0.0:
                self._rates[sensor] = (count - self._before.get(sensor, 0)) / elapsed_s
            self._before[sensor] = count
        self._at_s = now_s
        for sensor, places in SHOWN.items():
            reading = session.intake.latest.get(sensor)
            for place in places if reading else ():
                values = self._strips.setdefault(COLUMNS[sensor][place], deque(maxlen=STRIP))
                values.append(reading.value[place] if reading else float("nan"))


def protection_of(session: Session) -> tuple[float, float, str] | None:
    """Horizontal and vertical protection level [m], and the fault that is suspected ("" where none is); None before
    there are any.
    """
    on = session.filtering.running
    if on is None or not math.isfinite(on.work[PROTECTION]):
        return None
    suspected = int(on.work[SUSPECTED])
    horizontal_m, vertical_m = (float(level_m) for level_m in on.work[PROTECTION : PROTECTION + 2])
    return horizontal_m, vertical_m, NAMES[suspected - 1] if suspected else ""


def is_shown(session: Session, key: tuple[int, int]) -> bool:
    """Whether the newest reading of a sensor has the component: GPS over MAVLink has no vertical velocity to judge."""
    sensor, component = Sensor(key[0]), key[1]
    reading = session.intake.latest.get(sensor)
    return reading is None or component not in OPTIONAL.get(sensor, ()) or math.isfinite(reading.value[component])


def strip(values: deque[float]) -> str:
    """Values as a row of bars, from the least to the greatest of them; a blank where one is not finite."""
    finite = [value for value in values if math.isfinite(value)]
    low, high = min(finite, default=0.0), max(finite, default=0.0)
    scale = (len(BARS) - 1) / (high - low) if high > low else 0.0
    return "".join(BARS[round((value - low) * scale)] if math.isfinite(value) else " " for value in values)


def _figure(value: float) -> str:
    return f"{value:.2g}" if math.isfinite(value) else "-"
