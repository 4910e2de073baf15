"""The evidence of other sensors of two recorded logs on the named causes, which nobody had judged before."""

from __future__ import annotations

import itertools
import textwrap
from pathlib import Path

import numpy as np

from flownav.core.measurement import Sensor
from flownav.logs.open_log import open_log
from flownav.studies.explain.case import Case
from flownav.studies.explain.signals import Flags, at, stretches

OUTDOOR, INDOOR = "quad-px4flow-outdoor-3", "px4-voxl-indoor/voxl_two_flow_sensors.ulg"
GPS_LAG_S = 0.22  # of the recorder's GPS, by its own notes
EXPECTED_RAD_S = (0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0)
REPEATED_S, SPINS_S, GROUND_M = 1.5, 0.5, 0.07
TITLE = "## Two logs that nobody had judged, against their other sensors"


def witnessed(data: Path) -> str:
    """The section of the page; nothing where the logs are not at hand."""
    if not ((data / OUTDOOR).is_dir() and (data / INDOOR).is_file()):
        return ""
    outdoor, indoor = Case(open_log(data / OUTDOOR)), Case(open_log(data / INDOOR))
    return "\n".join([f"\n{TITLE}\n", flow_by_gps(outdoor), range_by_heights(outdoor), field_on_the_ground(indoor), ""])


def flow_by_gps(case: Case) -> str:
    """Flow without its turning beside GPS's velocity over the range, by how large that is."""
    assert case.flow is not None
    assert case.rates is not None
    assert case.gps_velocity is not None
    flow = case.flow
    good = flow.lifted & (flow.quality > 0.0) & np.isfinite(flow.range_m)
    t_s, range_m = flow.t_s[good], flow.range_m[good]
    seen = flow.value[good, :2] - at(case.rates[0], case.rates[1][:, :2], t_s)
    north, east = at(case.gps_velocity[0] - GPS_LAG_S, case.gps_velocity[1][:, :2], t_s).T
    r = case.rotation(t_s)
    expected = np.column_stack([-(r[1] * north + r[4] * east), r[0] * north + r[3] * east]) / range_m[:, None]
    size = np.hypot(*expected.T)
    along = np.sum(seen * expected, axis=1) / np.maximum(size, 1e-6)
    steps = np.abs(np.diff(seen, axis=0, prepend=seen[:1])).max(axis=1)
    text = _paragraph(
        f"**`{OUTDOOR}`, `flow_noise`: real.** GPS's velocity over the range says what the flow should be.",
        "Where it goes fastest, the readings fall far behind and jump the most from one to the next, while the quality",
        "stays the best that the sensor can tell: it is flown beyond what it can see.",
    )
    text += "| by GPS [rad/s] | readings | flow along it, median | step to the next, median | quality, median |\n"
    text += "|---|---|---|---|---|\n"
    for low, high in itertools.pairwise(EXPECTED_RAD_S):
        rows = (size >= low) & (size < high)
        if rows.sum() > 20:
            text += f"| {low:g} to {high:g} | {rows.sum()} | {np.median(along[rows]):.2f} | "
            text += f"{np.median(steps[rows]):.2f} | {np.median(flow.quality[good][rows]):.0f} |\n"
    return text


def range_by_heights(case: Case) -> str:
    """How far barometer and GPS moved while the range repeated one value for long."""
    stream = case.stream(Sensor.RANGE)
    assert stream is not None
    t_s, range_m = stream.t_s, stream.value[:, 0]
    repeats: Flags = np.concatenate([[False], np.diff(range_m) == 0.0])
    runs = [(max(a - 1, 0), b) for a, b in stretches(repeats) if t_s[b] - t_s[max(a - 1, 0)] > REPEATED_S]
    runs = [run for run in runs if case.flight_s[0] < t_s[run[0]] < case.flight_s[1]]
    text = _paragraph(
        f"**`{OUTDOOR}`, `range_stuck`: real.** The sonar repeats one value to the millimetre for longer than",
        f"{REPEATED_S} s in {len(runs)} stretches, of which these are the five in which barometer and GPS moved most:",
    )
    text += "| from [s] | to [s] | range [m] | barometer [m] | GPS [m] |\n|---|---|---|---|---|\n"
    moved = [[float(np.ptp(np.interp(t_s[a : b + 1], *case.other_heights[who]))) for who in ("barometer", "GPS")]
             for a, b in runs]  # fmt: skip
    for row in sorted(sorted(range(len(runs)), key=lambda k: -min(moved[k]))[:5]):
        a, b = runs[row]
        text += f"| {t_s[a]:.1f} | {t_s[b]:.1f} | {range_m[b]:.2f} | {moved[row][0]:.2f} | {moved[row][1]:.2f} |\n"
    return text


def field_on_the_ground(case: Case) -> str:
    """The field before the motors pull, and when they do while the range still says ground."""
    field, ranges = case.stream(Sensor.MAG), case.ranges
    assert field is not None
    assert ranges is not None
    assert case.own is not None
    height_m = np.interp(field.t_s, *ranges)
    leaves = float(field.t_s[(height_m > GROUND_M) & (field.t_s > case.flight_s[0] - 2.0)][0])
    rest = (field.t_s > leaves - 10.0) & (field.t_s < leaves - 4.0)
    pulls = (field.t_s > leaves - SPINS_S) & (field.t_s < leaves)
    before = np.median(field.value[rest], axis=0)
    change = field.value[pulls] - before
    most = float(np.linalg.norm(change, axis=1).max())
    usual = float(np.linalg.norm(field.value[rest] - before, axis=1).max())
    ends = np.interp([leaves - SPINS_S, leaves], case.own.t_s, case.own.pos_ned_m[:, 2])
    turn = np.degrees([case.attitude_yaw(leaves - 4.0), case.attitude_yaw(leaves)])
    end = case.flight_s[1]
    last, stands = (field.t_s > end - 1.0) & (field.t_s < end), field.t_s > end + 0.3
    back = float(np.linalg.norm(np.median(field.value[stands], axis=0) - np.median(field.value[last], axis=0)))
    usual_mgauss, back_mgauss = 1e3 * usual, 1e3 * back
    rises_cm, turns_deg = 1e2 * float(ends[0] - ends[1]), abs(float(turn[1] - turn[0]))
    text = _paragraph(
        f"**`{INDOOR}`, `compass_motors`: real, by half.** At {leaves:.1f} s the range leaves the {GROUND_M} m that it",
        f"reads on the ground. In the {SPINS_S} s before, the field changes by up to {1e3 * most:.0f} mgauss of",
        f"{1e3 * float(np.linalg.norm(before)):.0f}, before that by at most {usual_mgauss:.0f}, while the",
        f"vehicle by its own estimate, which flies on visual odometry, rises by {rises_cm:.0f} cm and turns by",
        f"{turns_deg:.0f}°: the motors' thrust is what changes. When they stop, {back_mgauss:.0f} mgauss",
        "come back; the rest may be iron in the floor of one of the two places. So the rule takes the lesser change.",
    )
    return text + _paragraph(
        "`terrain_step` was named beside it and is not there: the range went up and down with the vehicle's own",
        "velocity. The rule now asks every witness of vertical motion.",
    )


def _paragraph(*parts: str) -> str:
    return textwrap.fill(" ".join(parts), 118, break_long_words=False, break_on_hyphens=False) + "\n\n"
