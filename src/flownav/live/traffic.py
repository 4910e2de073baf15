"""How full a link is, each way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flownav.live.link import Link
from flownav.live.session import Session


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
        "flow_without_own_estimate": session.hearing.flow_waited,
        "frames_not_sent": link.counts["not_sent"],
    }


def in_words(facts: Mapping[str, Any]) -> str:
    """One line of `traffic_facts`: what came and went, of what the link carries, and what was not sent."""

    def one(bytes_s: float, share: float | None) -> str:
        return f"{bytes_s / 1e3:.1f} kB/s" + ("" if share is None else f" ({100.0 * share:.0f} %)")

    received, written = (one(facts[f"{way}_bytes_s"], facts[f"{way}_share"]) for way in ("received", "written"))
    said = [f"Link: in {received}, out {written}"]
    at_most = facts["estimate_hz_at_most"]
    said += [f"at most {at_most:.0f} estimates/s"] if at_most is not None else []
    said += [f"TOO SLOW for {facts['too_slow_for']}"] if facts["too_slow_for"] else []
    replaced, not_sent = facts["estimates_replaced"], facts["frames_not_sent"]
    said += [f"not sent: {replaced} old estimates, {not_sent} other frames"] if replaced or not_sent else []
    return "; ".join(said)
