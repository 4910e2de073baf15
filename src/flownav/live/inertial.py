"""Choice among a vehicle's inertial sensors: one whose accelerometer is stuck is replaced before the navigator uses it.

A stuck accelerometer is known by its content: it jumps, and then repeats one value while its gyro does not. Readings
wait at the horizon for longer than that takes, so that those of the stuck one can be taken back, and another's put
in their place, before the navigator has seen any.

Two that differ and are both alive contradict each other. Of three the one that is alone errs; of two gravity
decides: a vehicle that holds its height measures it, on average, and the sensor that does not measure it errs. A
rejected sensor is no witness against another until it has agreed with others for a while.
"""

import math
from collections import deque
from collections.abc import Collection, Iterable
from itertools import combinations
from statistics import fmean, median
from typing import NamedTuple

from flownav.core.frames import GRAVITY_M_S2
from flownav.core.measurement import Measurement, Sensor
from flownav.estimation.gating import Reason
from flownav.live.horizon import Source
from flownav.navigation.rows import InnovationRow

STUCK_S = 0.06  # chosen: six readings of a stream of 100 Hz; twelve of ArduPilot's 200
LEAST_STUCK = 5  # readings alike: chosen
KEPT_S = 1.0  # of those that do not serve: chosen, more than the horizon and what finds it
APART_M_S2 = 1.5  # medians that differ by more contradict each other: chosen, beyond two calibrated sensors' biases
FLICKER_M_S2 = 0.1  # of a stuck one: chosen, ten of the thousandths of g in which readings are sent
SURE = 4.0  # of the difference by chance: chosen
LOOK_S = 0.1  # of what is compared: chosen
LEAST_COMPARED, MOST_COMPARED = 3, 50  # readings of it; the most is chosen: 500 Hz, and a flood costs no more than that
MOST_KEPT = 1024  # readings of a source: chosen, a second of 1 kHz
BEFORE_S = 0.15  # readings shortly before that are wrong too: an autopilot smooths its readings; chosen
RECOVERED_S = 0.3  # since it erred last, where none serves: chosen
AGREED_S = 1.0  # likewise, where another serves: chosen
HIGHER_M = 0.4  # a height that is higher or lower than expected by this, or is refused, is a witness: chosen
TOGETHER_S = 0.5  # two that report so within this agree: chosen
DOUBTED_S = 1.0  # for this long after they reported it: chosen
Box = tuple[float, float, float, float, float, float]
EMPTY: Box = (math.inf, math.inf, math.inf, -math.inf, -math.inf, -math.inf)  # holds nothing: low, high of three axes
NEARLY = 0.999999  # of a square: beyond the last digits that a sum of squares loses
UP = {(Sensor.RANGE, 0): 1.0, (Sensor.BARO, 0): 1.0, (Sensor.GPS_POSITION, 2): -1.0}  # sign of an innovation, up


class Sample(NamedTuple):
    """A reading of one source."""

    t_s: float
    reading: Measurement


class Usual(NamedTuple):
    """Medians of an accelerometer's recent readings [m/s2], which a jolt that one stream has caught and another has
    missed does not move, and by how much they differ by chance under vibration.
    """

    force: tuple[float, float, float]
    by_chance: float


class _Span:
    """A box that holds every force of the last KEPT_S, and of at most KEPT_S more: of two spells, the later unended."""

    def __init__(self) -> None:
        self._since_s = math.nan
        self._now: Box = EMPTY
        self._before: Box = EMPTY

    def take(self, t_s: float, x: float, y: float, z: float) -> None:
        """A force at an instant."""
        if not t_s - self._since_s < KEPT_S:
            self._since_s, self._before, self._now = t_s, self._now, EMPTY
        a, b, c, d, e, f = self._now
        self._now = min(a, x), min(b, y), min(c, z), max(d, x), max(e, y), max(f, z)

    @property
    def box(self) -> Box:
        """Low and high along the three axes."""
        a, b, c, d, e, f = self._now
        g, h, i, j, k, m = self._before
        return min(a, g), min(b, h), min(c, i), max(d, j), max(e, k), max(f, m)


def are_near(one: Box, other: Box) -> bool:
    """Whether no force of one box, and so no median of some of them, can be apart from one of another."""
    square = 0.0
    for axis in range(3):
        square += max(other[axis + 3] - one[axis], one[axis + 3] - other[axis]) ** 2
    return square < NEARLY * APART_M_S2**2


class _SourceHistory:
    """The recent readings of one source, and since when its accelerometer has repeated one value."""

    def __init__(self) -> None:
        self.kept: deque[Sample] = deque(maxlen=MOST_KEPT)
        self._span = _Span()
        self.same_since_s = math.nan
        self.erred_s = -math.inf  # when it was stuck or contradicted last
        self.alike = 0
        self.healthy: Usual | None = None  # before it jumped
        self.gyro_moved = self.jumped = False

    def take(self, sample: Sample) -> None:
        before = self.kept[-1] if self.kept else None
        self.kept.append(sample)
        while self.kept[0].t_s < sample.t_s - KEPT_S:
            self.kept.popleft()
        value = sample.reading.value
        self._span.take(sample.t_s, *value[3:6])
        if before is None or value[3:] != before.reading.value[3:]:
            self.jumped = self._jumps(sample, before)
            self.same_since_s, self.alike, self.gyro_moved = sample.t_s, 1, False
            return
        self.alike += 1
        self.gyro_moved = self.gyro_moved or value[:3] != before.reading.value[:3]
        self.erred_s = sample.t_s if self.stuck else self.erred_s

    def _jumps(self, sample: Sample, before: Sample | None) -> bool:
        """Whether another value is one that it jumped to. The last digit of a stuck one may flicker."""
        force = sample.reading.value[3:6]
        if self.healthy is not None and math.dist(self.healthy.force, force) <= APART_M_S2:
            return False
        near = before is not None and math.dist(before.reading.value[3:6], force) <= FLICKER_M_S2
        if near and self.jumped and sample.t_s - self.erred_s < RECOVERED_S:
            return True
        x, y, z = force
        if are_near(self.box, (x, y, z, x, y, z)):
            return False
        columns = self._lately(sample.t_s - BEFORE_S)
        if columns is None or math.dist(map(median, columns), force) <= APART_M_S2:
            return False
        self.healthy = _usual_of(columns) if sample.t_s - self.erred_s > RECOVERED_S else self.healthy
        return True

    @property
    def stuck(self) -> bool:
        """Whether its accelerometer is stuck."""
        newest_s = self.kept[-1].t_s if self.kept else math.nan
        return self.jumped and self.gyro_moved and self.alike >= LEAST_STUCK and newest_s - self.same_since_s >= STUCK_S

    @property
    def box(self) -> Box:
        """The box of its forces of the last KEPT_S."""
        return self._span.box

    def usual(self, t_s: float) -> Usual | None:
        """Medians over the LOOK_S before an instant; None where there are too few readings."""
        columns = self._lately(t_s)
        return _usual_of(columns) if columns is not None else None

    def _lately(self, t_s: float) -> list[tuple[float, ...]] | None:
        """The forces of the LOOK_S before an instant, axis by axis; None where there are too few readings."""
        lately: list[tuple[float, ...]] = []
        for sample in reversed(self.kept):
            if t_s - sample.t_s > LOOK_S or len(lately) == MOST_COMPARED:
                break
            if sample.t_s <= t_s:
                lately.append(sample.reading.value[3:6])
        return list(zip(*lately, strict=True)) if len(lately) >= LEAST_COMPARED else None


def _usual_of(columns: list[tuple[float, ...]]) -> Usual:
    """The medians of forces."""
    x, y, z = map(median, columns)
    return Usual((x, y, z), math.sqrt(sum(map(_variance, columns)) / len(columns[0])))


def _variance(values: tuple[float, ...]) -> float:
    """Of a sample; statistics.variance reckons in fractions, a hundred times as long."""
    mean = fmean(values)
    return sum((value - mean) ** 2 for value in values) / (len(values) - 1)


class Swap(NamedTuple):
    """A source that must no longer be used, since when its readings are wrong, and another's readings since then."""

    barred: Source
    since_s: float
    why: str
    others: list[Sample]


class Inertial:
    """The inertial sensors of a vehicle, compared with each other."""

    def __init__(self) -> None:
        self._histories: dict[Source, _SourceHistory] = {}

    def clear(self) -> None:
        """Begin anew."""
        self._histories.clear()

    def received(
        self, source: Source, reading: Measurement, serves: Source | None, barred: Collection[Source] = ()
    ) -> Swap | None:
        """A reading of a source; what must be done where the one that serves is found wrong by it.

        barred: those that are not believed.
        """
        history = self._histories.setdefault(source, _SourceHistory())
        history.take(Sample(reading.t_s, reading))
        own = self._histories.get(serves) if serves is not None else None
        if serves is None or own is None or not own.kept:
            return None
        if own.stuck:
            return self._swap(serves, own.same_since_s - BEFORE_S, "stuck", barred)
        if source == serves and self._contradicted(serves, reading.t_s, barred):
            own.erred_s = reading.t_s
            return self._swap(serves, reading.t_s - BEFORE_S, "contradicted", barred)
        if source in barred and differ(own.usual(reading.t_s), history.usual(reading.t_s)):
            history.erred_s = reading.t_s
        return None

    def _swap(self, serves: Source, since_s: float, why: str, barred: Collection[Source]) -> Swap:
        """The replacement of a source: the readings since `since_s` of the first other source that is alive."""
        alive = self._alive(serves, self._histories[serves].kept[-1].t_s, barred)
        return Swap(
            serves, since_s, why, [sample for sample in alive[0].kept if sample.t_s >= since_s] if alive else []
        )

    def recovered(self, source: Source, t_s: float, *, alone: bool) -> bool:
        """Whether a source that erred agrees with one that does not. alone: none serves, so that none contradicts."""
        history = self._histories.get(source)
        return history is not None and t_s - history.erred_s >= (RECOVERED_S if alone else AGREED_S)

    def _alive(self, serves: Source, t_s: float, barred: Collection[Source]) -> list[_SourceHistory]:
        """Other sources that send readings, are not barred and are not stuck."""
        believed = (history for source, history in self._histories.items() if source != serves and source not in barred)
        return [
            history
            for history in believed
            if history.kept and t_s - history.kept[-1].t_s <= LOOK_S and not history.stuck
        ]

    def _contradicted(self, serves: Source, t_s: float, barred: Collection[Source]) -> bool:
        """Whether the source in use contradicts all others, or, of two, measures gravity less well than the other."""
        alive, box = self._alive(serves, t_s, barred), self._histories[serves].box
        if all(are_near(box, history.box) for history in alive):
            return False
        own = self._histories[serves].usual(t_s)
        if own is None:
            return False
        others = [other for other in (history.usual(t_s) for history in alive) if other is not None]
        against = [other for other in others if differ(own, other)]
        if not against or len(against) < len(others):
            return False
        if any(not differ(one, other) for one, other in combinations(against, 2)):
            return True
        least = min(abs(math.hypot(*other.force) - GRAVITY_M_S2) for other in against)
        return abs(math.hypot(*own.force) - GRAVITY_M_S2) > least + 0.5 * APART_M_S2


def differ(one: Usual | None, other: Usual | None) -> bool:
    """Whether two accelerometers differ by more than chance allows."""
    if one is None or other is None:
        return False
    by_chance = math.hypot(one.by_chance, other.by_chance)
    return math.dist(one.force, other.force) > APART_M_S2 + SURE * by_chance


class Heights:
    """Compares range, barometer and GPS with the height that the inertial sensors carry on.

    One alone may meet a step of the ground, a gust or a slow error. Two that agree, one of them so far off that the
    filter refuses it, are right: then neither height nor vertical velocity is sent.
    """

    def __init__(self) -> None:
        self._refusals: dict[Sensor, tuple[float, float, bool]] = {}  # when, how much higher [m], whether refused
        self._doubted_s = math.nan

    def clear(self) -> None:
        """Begin anew."""
        self._refusals.clear()
        self._doubted_s = math.nan

    def judged(self, rows: Iterable[InnovationRow[float]]) -> None:
        """Take the navigator's verdicts on readings."""
        for row in rows:
            sign = UP.get((Sensor(int(row.sensor)), int(row.component)))
            reason = int(row.reason)
            if sign is None or reason not in (Reason.FUSED, Reason.INNOVATION_GATE):
                continue
            higher_m = sign * row.innovation
            self._refusals[Sensor(int(row.sensor))] = row.t_s, higher_m, reason == Reason.INNOVATION_GATE
            lately = [
                (much_m, refused)
                for stated_s, much_m, refused in self._refusals.values()
                if row.t_s - stated_s <= TOGETHER_S and abs(much_m) >= HIGHER_M and much_m * higher_m > 0.0
            ]
            if len(lately) > 1 and any(refused for _, refused in lately):
                self._doubted_s = row.t_s

    def doubted(self, t_s: float) -> bool:
        """Whether the height is doubted at an instant."""
        return t_s - self._doubted_s <= DOUBTED_S
