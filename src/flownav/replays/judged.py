"""The scores of a replay besides its errors: when the vehicle flew, innovations, coverage, sensors that do not
serve, the autopilot's own estimate, and the data that a log lacks to be replayed."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import POSITION_NED, QUATERNION, Table
from flownav.estimation.gating import Reason
from flownav.logs.log import Log
from flownav.navigation.feed import SLOWEST_IMU_HZ, imu_serves, rate_hz
from flownav.navigation.reasons import HORIZONTAL, REFUSALS
from flownav.navigation.rows import InnovationRow
from flownav.replays.prepare import GPS
from flownav.replays.sentinel import Finding
from flownav.scoring.consistency import aloft, consistency_by_sensor
from flownav.scoring.coverage import coverage_of
from flownav.scoring.path import autopilot_errors, moved_by, placed_in
from flownav.scoring.reference import Alignment, flight_of

ON_THE_GROUND = 20  # readings of a range that starts on the ground: chosen, 0.4 to 2 s
LIFTED_M = 0.3  # sound ranges vary by 0.01 m on the ground (indoor-made); outdoor-2's sonar jumps, and errs by 4 s
NEAR_M = 0.1  # the way from here up to where it is surely lifted is flight already: chosen

Window = tuple[float, float]
AIDS = (Sensor.GPS_POSITION, Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY)
NO_REJECTION = (Reason.FUSED, Reason.DATUM)
TESTED = (Reason.FUSED, Reason.INNOVATION_GATE)
# components that a sensor may leave out: a NaN here means not stated, not a reading that is broken
MAY_BE_LEFT_OUT = ((Sensor.GPS_VELOCITY, 2), (Sensor.FLOW_VELOCITY, 2), (Sensor.PAD, 2))
LEAST_READINGS = 20  # chosen: 4 s of a 5 Hz receiver
LEAST_SHARE = 0.2  # chosen: a live session fuses the readings of its first two seconds, however late
LATE = Reason.LATE.label  # readings that a live session's horizon left out never reached the navigator


def airborne_of(log: Log) -> Window | None:
    """From the first lift-off to the last touchdown [s]; None where the log does not show it."""
    if Sensor.LANDED in log.streams:
        landed = log.streams[Sensor.LANDED]
        flying = np.flatnonzero(landed.value[:, 0] < 0.5)
        if len(flying):
            last = flying[-1] + 1
            return float(landed.t_s[flying[0]]), float(landed.t_s[last]) if last < len(landed) else log.span_s[1]
    if log.truth is not None:
        return flight_of(np.asarray(log.truth["t_s"], float), np.asarray(log.truth["pos_d_m"], float))
    if Sensor.RANGE not in log.streams or len(log.streams[Sensor.RANGE]) < ON_THE_GROUND:
        return None
    distance = log.streams[Sensor.RANGE]
    height_m = distance.value[:, 0] - np.median(distance.value[:ON_THE_GROUND, 0])
    away = np.flatnonzero(height_m > LIFTED_M)
    if not len(away):
        return None
    near = np.flatnonzero(height_m <= NEAR_M)
    before, after = near[near < away[0]], near[near > away[-1]]
    first = before[-1] + 1 if len(before) else away[0]
    last = after[0] - 1 if len(after) else away[-1]
    return float(distance.t_s[first]), float(distance.t_s[last])


def flying_at(log: Log, t_s: Array) -> NDArray[np.bool_]:
    """Which instants (n,) lie in flight, stops on the ground between cut out; all where the log does not show it."""
    window = airborne_of(log)
    if window is None:
        return np.ones(len(t_s), bool)
    inside = (t_s >= window[0]) & (t_s <= window[1])
    if Sensor.LANDED not in log.streams:
        return np.asarray(inside)
    landed = log.streams[Sensor.LANDED]
    row = np.clip(np.searchsorted(landed.t_s, t_s, side="right") - 1, 0, len(landed) - 1)
    airborne = landed.value[row, 0] < 0.5
    return np.asarray(inside & airborne if (landed.value[:, 0] < 0.5).any() else inside)


def obstacles(log: Log) -> list[str]:
    """The data that the log lacks to be replayed, one line each; none where it can be replayed."""
    found = []
    if Sensor.ATTITUDE not in log.streams and not imu_serves(log.streams):
        slow = Sensor.IMU in log.streams
        has = f"its IMU has {rate_hz(log.streams[Sensor.IMU].t_s):.1f} Hz" if slow else "it has no IMU"
        found.append(f"no attitude, and {has}: one of them is needed, an IMU of {SLOWEST_IMU_HZ:g} Hz or more")
    if not log.streams.keys() & set(AIDS):
        found.append("neither GPS nor optical flow: nothing to hold the position")
    return found


def consistency_scores(innovation: Array, landed: Stream | None = None) -> dict[str, dict[str, Any]]:
    """By sensor, of the components that were held against their prediction in flight; innovation: rows of a tape's.

    landed: the landed signal; without one all of it is flight.
    """
    offered = InnovationRow.of(innovation)
    tested = np.isin(offered.reason, TESTED)
    if landed is not None:
        tested &= aloft(offered.t_s, landed.t_s, landed.value[:, 0])
    return consistency_by_sensor(
        lambda sensor: tested & (offered.sensor == sensor), offered.reason == Reason.FUSED,
        offered.component, offered.innovation, offered.innovation_variance,
    )  # fmt: skip


def before_delay(innovation: Array) -> Array:
    """The offered components without those that their sensor left out (MAVLink's GPS has no vertical velocity).

    A component is left out where it is NaN and another of the same reading is not.
    """
    offered = InnovationRow.of(innovation)
    silent = np.isnan(offered.observation)
    kept = np.ones(len(innovation), bool)
    for sensor, component in MAY_BE_LEFT_OUT:
        of_sensor = offered.sensor == sensor
        beside = np.isin(offered.t_s, offered.t_s[of_sensor & np.isfinite(offered.observation)])
        left_out = (offered.component == component) & silent & (offered.reason == Reason.NOT_FINITE)
        kept &= ~(of_sensor & beside & left_out)
    return np.asarray(innovation[kept])


def reading_scores(innovation: Array, streams: Mapping[Sensor, Stream]) -> dict[str, dict[str, Any]]:
    """Counts of whole readings by sensor and outcome, where `rejected` counts components; innovation: rows of a tape's.

    offered to the filter; read: these and the rows that the reader threw away; fused: with every component, or with
    some of them (in_part); rejected: readings that lost one component or more, by reason, with the rows that the reader
    threw away.
    """
    found = {}
    innovation = before_delay(innovation)
    for sensor, stream in streams.items():
        offers = InnovationRow.of(innovation[InnovationRow.of(innovation).sensor == sensor])
        reading, reason = _readings(offers), offers.reason.astype(int)
        count = int(reading[-1]) + 1 if len(reading) else 0
        components = np.bincount(reading, minlength=count)
        fused = np.bincount(reading, weights=reason == Reason.FUSED, minlength=count)
        lost = {r.label: len(np.unique(reading[reason == r])) for r in Reason if r not in NO_REJECTION}
        rejected = dict(Counter(stream.rejected) + Counter(lost))
        if count or rejected:
            found[sensor.name.lower()] = {
                "offered": count,
                "read": count + sum(stream.rejected.values()),
                "fused": int(np.count_nonzero((fused == components) & (fused > 0))),
                "in_part": int(np.count_nonzero((fused < components) & (fused > 0))),
                "rejected": rejected,
            }
    return found


def _readings(offers: InnovationRow[Array]) -> NDArray[np.int_]:
    """The number of the reading that each component of one sensor belongs to: components of one count up."""
    if not len(offers.t_s):
        return np.zeros(0, int)
    begins = (np.diff(offers.t_s) != 0.0) | (np.diff(offers.component) <= 0.0)
    return np.concatenate([[0], np.cumsum(begins)]).astype(int)


def coverage_scores(log: Log) -> dict[str, dict[str, float]]:
    """By stream, its first and last reading [s]."""
    return {name: {"t0": first, "t1": last} for name, (first, last) in coverage_of(log.streams).items()}


def unfused(innovation: Array, streams: Mapping[Sensor, Stream]) -> list[Finding]:
    """One finding for each; innovation: rows of a tape's. Readings that were cut or know nothing do not count."""
    found, offered = [], InnovationRow.of(innovation)
    for sensor in HORIZONTAL:
        rows = InnovationRow.of(innovation[(offered.sensor == sensor) & (offered.component < 2)])
        if sensor not in streams:
            continue
        fused = len(np.unique(rows.t_s[rows.reason == Reason.FUSED]))
        first = rows.reason[(rows.component == 0) & np.isin(rows.reason, REFUSALS)].astype(int)
        why = Counter(Reason(reason).label for reason in first.tolist())
        why[LATE] += streams[sensor].rejected.get(LATE, 0)
        if why.total() >= LEAST_READINGS and fused < LEAST_SHARE * (fused + why.total()):
            reasons = ", ".join(f"{reason} {count}" for reason, count in why.most_common() if count)
            sentence = f"{sensor.name.lower()} was received and {'hardly' if fused else 'never'} fused"
            text = f"{sentence} ({fused} readings; {reasons}): the estimate rests on the other sensors"
            found.append(Finding(text, unfused=True))
    return found


def placed_here(log: Log, gps_delay_s: float, t_s: Array, position: Array) -> Alignment | None:
    """The alignment of the autopilot's frame with ours, t_s (n,) and position (n, 3); None without an estimate of its
    own.
    """
    return None if log.autopilot is None else placed_in(t_s, position, log.autopilot, _gps(log, gps_delay_s))


def autopilot_path(log: Log, placed: Alignment | None) -> Table | None:
    """The autopilot's estimate in the frame of ours (`placed_here`); None where there is none.

    Columns as record.TABLES["autopilot"].
    """
    return None if placed is None or log.autopilot is None else moved_by(log.autopilot, placed)


def setpoints(log: Log, placed: Alignment | None) -> Table | None:
    """The autopilot's set-points in our frame (`placed_here`): one table, NaN where there is none.

    Columns as record.TABLES["setpoint"]; None without any. Where the relation of the frames is unknown there is no
    position, and the attitude is as the log has it.
    """
    turned = Alignment(0.0, (0.0, 0.0, 0.0)) if placed is None else placed
    usable = [one for one in log.setpoints if len(one["t_s"]) and (placed is not None or POSITION_NED[0] not in one)]
    moved = [moved_by(table, turned) for table in usable]
    times = np.unique(np.concatenate([table["t_s"] for table in moved])) if moved else np.zeros(0)
    names = [name for name in (*POSITION_NED, *QUATERNION) if any(name in table for table in moved)]
    joined = {"t_s": times} | {name: np.full(len(times), np.nan) for name in names}
    for table in moved:
        rows = np.searchsorted(times, table["t_s"])
        for name in table.keys() - {"t_s"}:
            joined[name][rows] = table[name]
    return joined if len(times) else None


def autopilot_scores(log: Log, gps_delay_s: float) -> dict[str, Any] | None:
    """Name of the autopilot's estimator and the errors of its estimate (scoring/autopilot); None without one."""
    if log.autopilot is None:
        return None
    return {"name": log.autopilot_name, **autopilot_errors(log.autopilot, log.truth, _gps(log, gps_delay_s))}


def _gps(log: Log, delay_s: float) -> dict[Sensor, Stream]:
    """GPS as the log has it, withheld or not, with its delay."""
    return {sensor: replace(log.streams[sensor], delay_s=delay_s) for sensor in GPS if sensor in log.streams}
