"""A replay: a log through the filter, its scores, and a table of GPS outages."""

from collections import Counter
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from flownav.core.compile import announce_compilation
from flownav.core.errors import InputError, arg
from flownav.core.measurement import Array, EventQueue, Sensor, Stream
from flownav.core.record import POSITION_NED, Table
from flownav.estimation.gating import Reason
from flownav.logs.log import Log
from flownav.navigation.feed import SLOWEST_IMU_HZ, equipment_of
from flownav.navigation.flags import flagged, flags_of
from flownav.navigation.loop import Instead, Running, run, start_navigator
from flownav.navigation.rows import EstimateRow, InnovationRow
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.navigation.smoother import smooth
from flownav.navigation.tables import Written, estimate_table, written_on
from flownav.navigation.tape import new_tape, tape_for
from flownav.replays import judged
from flownav.replays.fed import prepared_as_fed, run_as_fed
from flownav.replays.prepare import GPS, Prepared, ReplayOptions, check_windows, prepare, withhold
from flownav.replays.sentinel import Finding, findings
from flownav.scoring import path as scored
from flownav.scoring.coverage import silences
from flownav.scoring.path import columns_of
from flownav.scoring.recorded import estimate_scores
from flownav.scoring.reference import Alignment, OutageError

HORIZONTAL = (*GPS, Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY)
LONGEST_TABLE = 2000  # chosen: a replay each, hours of them
FED_BEYOND = 2048  # readings at a time after the end of what is asked for, until an estimate lies beyond it
COMPILED = "what a replay needs, once, about 20 s"  # the message while it is compiled
LEAST_WINDOW_S = 1e-6  # what rounding leaves of a window is none


@dataclass(frozen=True)
class Replay:
    """One run of a log through the filter."""

    log: Log
    options: ReplayOptions
    settings: NavigatorSettingsFile
    prepared: Prepared
    written: Written
    smoothed: Array | None = None  # the estimate smoothed over the whole log, where that was asked for

    @property
    def estimate(self) -> Array:
        """The navigator's estimates: rows of `navigation.rows.EstimateRow`."""
        return self.written.estimate

    @property
    def innovation(self) -> Array:
        """The verdict on each component: rows of `navigation.rows.InnovationRow`."""
        return self.written.innovation

    @property
    def estimate_rows(self) -> EstimateRow[Array]:
        """The columns of the estimates."""
        return EstimateRow.of(self.estimate)

    @property
    def offered(self) -> InnovationRow[Array]:
        """The columns of the verdicts on each component."""
        return InnovationRow.of(self.innovation)

    @cached_property
    def attitude(self) -> Stream:
        """The estimated attitude."""
        return Stream.of(Sensor.ATTITUDE, self.estimate_rows.t_s, self.estimate_rows.quaternion)

    @cached_property
    def findings(self) -> list[Finding]:
        """The errors of the log that its sensors show, and whether anything was fused at all."""
        fused = self.offered.sensor[self.offered.reason == Reason.FUSED]
        found = findings({Sensor.ATTITUDE: self.attitude, **self.prepared.streams}, self.options.gps_outages_s)
        if not np.isin(fused, HORIZONTAL).any():
            what = "horizontal was fused" if len(fused) else "was fused"
            text = f"nothing {what}: the path is dead reckoning on attitude and accelerometer alone"
            found.append(Finding(text, label="Note"))
        found += judged.unfused(self.innovation, self.log.streams)
        return found + [Finding(text) for text in silences(self.log.streams, self.log.span_s)]

    @cached_property
    def table(self) -> Table:
        """The estimate as a record has it."""
        return estimate_table(self.estimate)

    @cached_property
    def references(self) -> scored.References:
        """The references in the log that the path is scored against."""
        return references_of(self.log, self.options)

    @cached_property
    def truth_alignment(self) -> Alignment | None:
        """How the log's truth lies in the estimate's frame; None without a truth that overlaps."""
        return scored.truth_alignment(scored.path_of(self.table), self.log.truth)

    @cached_property
    def truth_position(self) -> Array:
        """The log's truth (n, 3) in its own frame."""
        return columns_of(self.log.truth or {}, POSITION_NED)

    def outage(self, t0: float, t1: float) -> OutageError:
        """The outage error over a window."""
        return scored.outage_of(scored.path_of(self.table), self.references, t0, t1)

    def rejected(self) -> dict[str, dict[str, int]]:
        """Counts of rejections by sensor and reason: rows by the reader, components by the filter, added up."""
        counts = {}
        offered = InnovationRow.of(judged.before_delay(self.innovation))
        sensors, reasons = offered.sensor.astype(int), offered.reason.astype(int)
        for sensor, stream in self.log.streams.items():
            numbers = np.bincount(reasons[sensors == sensor], minlength=len(Reason))
            found = {r.label: int(numbers[r]) for r in Reason if numbers[r] and r not in judged.NO_REJECTION}
            if found or stream.rejected:
                counts[sensor.name.lower()] = dict(Counter(stream.rejected) + Counter(found))
        return counts

    def scores(self) -> dict[str, Any]:
        """The output of `--json`, except the outage table and the record's path."""
        start, end = self.log.span_s
        warned = flagged(self.estimate_rows.t_s, flags_of(self.written.event))
        scores: dict[str, Any] = {
            **estimate_scores(self.table, self.references, end - start, warned),
            "consistency": judged.consistency_scores(self.innovation, self.log.streams.get(Sensor.LANDED)),
            "coverage": judged.coverage_scores(self.log),
            "rejected": self.rejected(),
            "readings": judged.reading_scores(self.innovation, self.log.streams),
            "warnings": [finding.text for finding in self.findings],
        }
        own = judged.autopilot_scores(self.log, self.options.gps_delay_s)
        scores |= {} if own is None else {"autopilot": own}
        if self.smoothed is not None:
            scores["smoothed"] = scored.path_scores(estimate_table(self.smoothed), self.references)
        return scores


def references_of(log: Log, options: ReplayOptions) -> scored.References:
    """The references in a log: its GPS, withheld or not, and its truth."""
    fixes, speeds = (log.streams.get(sensor) for sensor in GPS)
    return scored.References(
        fixes=None if fixes is None else (fixes.t_s, fixes.value),
        speeds=None if speeds is None else (speeds.t_s, speeds.value),
        gps_delay_s=options.gps_delay_s,
        outages_s=options.gps_outages_s,
        truth=log.truth,
        truth_name=log.truth_name,
        heading=log.heading_truth,
        flight_s=judged.airborne_of(log),
    )


def replay(
    log: Log, options: ReplayOptions, settings: NavigatorSettingsFile, *, smoothed: bool = False,
    instead: Instead | None = None,
) -> Replay:  # fmt: skip
    """Run a log through the filter, and back through it for a smoothed path.

    instead: gives the address of what takes the readings of a navigator in its place (room parts/).
    InputError where an option cannot be, the filter never starts, or a live session's record, or another filter's
    path, is to be smoothed.
    """
    if smoothed and log.fed:
        raise InputError(f"{log.path}: {arg('smooth')} takes a log; a live session's record is replayed as it was fed")
    if smoothed and instead is not None:
        raise InputError(f"{log.path}: {arg('smooth')} smooths our own filter's path; leave it out with another filter")
    with announce_compilation("replay", COMPILED):
        prepared = prepared_as_fed(log) if log.fed else prepare(log, options)
        return _run(log, options, settings, prepared, smoothed=smoothed, instead=instead)


def replay_again(flown: Replay, options: ReplayOptions, settings: NavigatorSettingsFile) -> Replay:
    """Replay the same streams, prepared once, with other GPS and flow cuts and settings; other options stay.

    InputError where the filter never starts.
    """
    return _run(flown.log, options, settings, flown.prepared)


def outage_table(
    log: Log,
    options: ReplayOptions,
    settings: NavigatorSettingsFile,
    windows: list[tuple[float, float]],
    on_progress: Callable[[int], object] = lambda done: None,
) -> list[OutageError]:
    """One replay a window and no further, each with GPS cut in that window alone.

    `on_progress` is called with 1 for each.

    InputError where a window lies outside the log.
    """
    check_windows(log, windows, arg("outage_table"))

    def error_of(window: tuple[float, float]) -> OutageError:
        cut = replace(options, gps_outages_s=(window,))
        return _run(log, cut, settings, prepared, until_s=window[1]).outage(*window)

    errors = []
    with announce_compilation("replay", COMPILED), ThreadPoolExecutor(2) as pool:
        prepared = prepared_as_fed(log) if log.fed else prepare(log, replace(options, gps_outages_s=()))
        for error in pool.map(error_of, windows):
            errors.append(error)
            on_progress(1)
    return errors


def table_windows(
    t0: float, t1: float, length_s: float, *, option: str = arg("outage_table")
) -> list[tuple[float, float]]:
    """[t0, t0 + length), ... up to t1, the last one shorter where t1 asks for it.

    InputError where that is no list of windows; `option` asked for it.
    """
    if not (t0 < t1 and length_s > 0.0 and np.isfinite([t0, t1, length_s]).all()):
        raise InputError(f"{option} {t0:g}:{t1:g}:{length_s:g}: T0:T1:LENGTH is needed, seconds, T0 before T1")
    count = int(np.floor((t1 - t0) / length_s + 1e-9))
    if not 1 <= count <= LONGEST_TABLE:
        raise InputError(
            f"{option} {t0:g}:{t1:g}:{length_s:g}: that is {count} windows; 1 to {LONGEST_TABLE} can be flown"
        )
    whole = [(t0 + k * length_s, t0 + (k + 1) * length_s) for k in range(count)]
    return whole if t1 - whole[-1][1] < LEAST_WINDOW_S else [*whole, (whole[-1][1], t1)]


def outage_summary(errors: list[OutageError]) -> dict[str, float | None]:
    """Median and worst rms of the windows that could be scored; null without any."""
    rms = np.array([error.horizontal_rms_m for error in errors])
    rms = rms[np.isfinite(rms)]
    if not len(rms):
        return {"outage_median_rms_m": None, "outage_worst_rms_m": None}
    return {"outage_median_rms_m": float(np.median(rms)), "outage_worst_rms_m": float(rms.max())}


def _feed(parts: Iterable[EventQueue], on: Running, instead: int | None, until_s: float) -> None:
    """Feed the parts of a queue, as far as it takes for estimates at every instant until `until_s`."""
    for part in parts:
        count = len(part.t_s)
        ends = range(int(np.searchsorted(part.t_s, until_s, side="right")), count, FED_BEYOND)
        for begin, end in pairwise([0, *ends, count]):
            run(EventQueue._make(column[begin:end] for column in part), on, instead=instead)
            if np.isfinite(until_s):
                written_s = EstimateRow.of(written_on(on.tape).estimate).t_s
                if len(written_s) > 1 and written_s[-1] > until_s:
                    return


def _run(
    log: Log, options: ReplayOptions, settings: NavigatorSettingsFile, prepared: Prepared, *, smoothed: bool = False,
    instead: Instead | None = None, until_s: float = float("inf"),
) -> Replay:  # fmt: skip
    path = None
    if log.fed:
        written = run_as_fed(log, options, settings, lambda queue: withhold(log, queue, options), instead)
    else:
        first_s, last_s = prepared.span_s
        equipment = equipment_of(prepared.streams, first_s, prepared.flow_gyro_is_imu, settings, log.origin_deg_m)
        tape = tape_for({sensor: len(stream) for sensor, stream in prepared.streams.items()}, last_s - first_s)
        running = start_navigator(equipment, settings, tape, options.flow_noise)
        address = None if instead is None else instead(running)
        _feed((withhold(log, part, options) for part in prepared.parts()), running, address, until_s)
        if smoothed:
            queue = withhold(log, prepared.queue, options)
            path = smooth(queue, start_navigator(equipment, settings, new_tape(queue), options.flow_noise))
        written = written_on(running.tape)
    if len(written.estimate) < 2:
        raise InputError(
            f"{log.path}: the filter never started; it needs an attitude or an IMU of {SLOWEST_IMU_HZ:g} Hz, then a "
            "GPS fix or flow of quality above 0"
        )
    return Replay(log, options, settings, prepared, written, path)
