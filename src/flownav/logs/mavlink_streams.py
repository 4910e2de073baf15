"""Readings of many messages and sensors gathered by source, and the one source chosen for each kind of sensor."""

from __future__ import annotations

from array import array
from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from flownav.core.errors import InputError
from flownav.core.measurement import COLUMNS, Array, Measurement, Sensor, Stream
from flownav.logs.mavlink.converted import Outcome
from flownav.logs.mavlink.messages import PREFERENCE

ENOUGH_SHARE = 0.5  # a preferred source with this share of the readings of the most frequent one is taken
FLOW = (Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY)


class Source(NamedTuple):
    """Who measured: component, message and instance."""

    component: int
    message: str
    instance: int

    def __str__(self) -> str:
        return f"{self.message} {self.instance} of component {self.component}"


@dataclass
class Readings:
    """One sensor's readings from one source: rows of time, values, variances, quality, delay."""

    rows: array[float] = field(default_factory=lambda: array("d"))
    rejected: Counter[str] = field(default_factory=Counter)
    last: tuple[float, ...] = ()
    useful: int = 0  # readings of quality above 0

    def take(self, outcome: Outcome) -> None:
        """Keep a measurement, count a dropped one; one that repeats its predecessor, time and all, counts too."""
        if not isinstance(outcome, Measurement):
            self.rejected[outcome.reason] += 1
            return
        value_at = (outcome.t_s, *outcome.value)
        if value_at == self.last:
            self.rejected["duplicate"] += 1
            return
        self.last = value_at
        self.useful += outcome.quality > 0
        self.rows.extend((*value_at, *outcome.variance, outcome.quality, outcome.delay_s))

    def stream(self, sensor: Sensor) -> Stream:
        """The readings in the order of their times."""
        width = len(COLUMNS[sensor])
        table: Array = np.frombuffer(self.rows, float).reshape(-1, 2 * width + 3)
        table = table[np.argsort(table[:, 0], kind="stable")]
        return Stream.of(
            sensor,
            table[:, 0],
            table[:, 1 : 1 + width],
            variance=table[:, 1 + width : 1 + 2 * width],
            quality=table[:, -2],
            delay_s=float(np.median(table[:, -1])) if len(table) else 0.0,
            rejected=dict(self.rejected),
        )


@dataclass
class Gathered:
    """Every source's readings, by sensor."""

    sources: dict[Sensor, dict[Source, Readings]] = field(default_factory=dict)

    def take(self, source: Source, outcome: Outcome) -> None:
        """Put one outcome where it belongs."""
        found = self.sources.setdefault(outcome.sensor, {})
        if source not in found:
            found[source] = Readings()
        found[source].take(outcome)

    def streams(self, flow_instance: int | None) -> tuple[dict[Sensor, Stream], list[str]]:
        """One stream a sensor, and a note on each source left out. InputError where no flow is of that instance."""
        wanted = self._of_flow_instance(flow_instance)
        chosen: dict[Sensor, Stream] = {}
        notes: list[str] = []
        for sensor, sources in sorted(wanted.items()):
            if sensor == Sensor.FLOW_VELOCITY and any(r.useful for r in wanted.get(Sensor.FLOW_RATE, {}).values()):
                notes.append("flow_velocity is left out: flow_rate is of the same flow")
                continue
            source = _best(sensor, sources)
            stream = sources[source].stream(sensor)
            if len(stream):
                chosen[sensor] = stream
            else:
                reasons = ", ".join(f"{count} {reason}" for reason, count in sources[source].rejected.items())
                notes.append(f"{sensor.name.lower()}: no reading of {source} is usable ({reasons})")
            left = {other: found.useful for other, found in sources.items() if other != source and found.useful}
            others = [f"{other} ({count})" for other, count in left.items()]
            if others:
                notes.append(f"{sensor.name.lower()} is of {source} ({len(stream)}); left out: {', '.join(others)}")
        return chosen, notes

    def _of_flow_instance(self, instance: int | None) -> dict[Sensor, dict[Source, Readings]]:
        if instance is None:
            return self.sources
        present = sorted({source.instance for sensor in FLOW for source in self.sources.get(sensor, {})})
        if instance not in present:
            listed = ", ".join(map(str, present)) or "none"
            raise InputError(f"flow instance {instance}: the log has no such flow sensor; its flow instances: {listed}")
        return {
            sensor: {
                source: readings
                for source, readings in sources.items()
                if sensor not in FLOW or source.instance == instance
            }
            for sensor, sources in self.sources.items()
        }


def _best(sensor: Sensor, sources: dict[Source, Readings]) -> Source:
    """The preferred message among the sources with many readings, then the most readings, then the lowest numbers."""
    order = PREFERENCE.get(sensor, ())
    most = max(readings.useful for readings in sources.values())
    often = [source for source, readings in sources.items() if readings.useful >= ENOUGH_SHARE * most]

    def rank(source: Source) -> tuple[int, int, int, int]:
        place = order.index(source.message) if source.message in order else len(order)
        return place, -sources[source].useful, source.component, source.instance

    return min(often, key=rank)
