"""GPS cut on a timeline: the log that is at hand, replayed again without GPS, flow or with flow scaled."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from flownav.app.looking import thinned
from flownav.core.errors import arg
from flownav.core.measurement import Array, Sensor
from flownav.core.record import POSITION_NED
from flownav.logs.log import Log
from flownav.logs.open_log import open_flight
from flownav.replays.fed import as_fed
from flownav.replays.prepare import ReplayOptions, check_windows
from flownav.replays.session import Replay, replay, replay_again
from flownav.scoring.path import columns_of

POINTS = 700  # of a drawn path
MOST_CUTS = 20

Key = tuple[Any, ...]
_kept: dict[Key, Replay] = {}  # the log that was replayed last, with what its streams were prepared with


def drift_of(asked: dict[str, Any]) -> dict[str, Any]:
    """A log with GPS withheld in windows, and the path that the navigator makes of it.

    asked: path; cuts, a list of (t0, t1) [s]; flow, whether it is fused; flow_scale, its two factors; gps_delay_s.
    Gives span_s; outages, each with horizontal_rms_m and horizontal_max_m (None where GPS or truth do not cover it);
    path and gps, north and east [m]; away, the distance from GPS over time, (t_s, m). InputError as
    `flownav replay`.
    """
    cuts = tuple((float(t0), float(t1)) for t0, t1 in asked.get("cuts", [])[:MOST_CUTS])
    base = _at_hand(asked)
    check_windows(base.log, cuts, arg("gps_outages"))
    options = replace(base.options, gps_outages_s=cuts, use_flow=bool(asked.get("flow", True)))
    options, settings = as_fed(base.log, options, None)
    flown = replay_again(base, options, settings)
    way = columns_of(flown.table, POSITION_NED)
    return {
        "span_s": list(base.log.span_s),
        "against": flown.references.truth_name if base.log.truth is not None else "GPS",
        "outages": [_figures(flown, *cut) for cut in cuts],
        "path": thinned(way, POINTS),
        "gps": thinned(_fixes(base.log), POINTS),
        "away": _away(flown),
    }


def _at_hand(asked: dict[str, Any]) -> Replay:
    """The log, replayed once with nothing cut; it is kept until another is asked for."""
    path, scale = Path(asked["path"]), asked.get("flow_scale") or (1.0, 1.0)
    info = path.stat()
    options = ReplayOptions(flow_scale=(float(scale[0]), float(scale[1])))
    if "gps_delay_s" in asked:
        options = replace(options, gps_delay_s=float(asked["gps_delay_s"]))
    key = (str(path), info.st_mtime, info.st_size, options.flow_scale, options.gps_delay_s)
    if key not in _kept:
        same = [kept.log for known, kept in _kept.items() if known[:3] == key[:3]]
        log = same[0] if same else open_flight(path)
        flown = replay(log, *as_fed(log, options, None))
        _kept.clear()
        _kept[key] = flown
    return _kept[key]


def _figures(flown: Replay, t0: float, t1: float) -> dict[str, Any]:
    error = flown.outage(t0, t1)
    return {name: None if not np.isfinite(value) else float(value) for name, value in error._asdict().items()}


def _fixes(log: Log) -> Array:
    stream = log.streams.get(Sensor.GPS_POSITION)
    return np.zeros((0, 3)) if stream is None else stream.value[:, :3]


def _away(flown: Replay) -> list[list[float]]:
    """The horizontal distance of the estimate from GPS where there is a fix, over time; empty without GPS."""
    stream = flown.log.streams.get(Sensor.GPS_POSITION)
    if stream is None:
        return []
    table, at = flown.table, stream.t_s - flown.options.gps_delay_s
    own = np.column_stack([np.interp(at, table["t_s"], table[name], np.nan, np.nan) for name in POSITION_NED[:2]])
    away = np.hypot(*(own - stream.value[:, :2]).T)
    rows = np.linspace(0, len(at) - 1, min(POINTS, len(at))).round().astype(int)
    return [[round(float(at[k]), 3), round(float(away[k]), 3)] for k in rows if np.isfinite(away[k])]
