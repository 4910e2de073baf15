"""Signs in the parameters, held against each other and against what the log shows of the flight."""

import numpy as np

from flownav.core.measurement import Sensor
from flownav.logs.happened import SOURCE_SET
from flownav.studies.explain.autopilot_settings import PX4, RANGE
from flownav.studies.explain.case import Case
from flownav.studies.explain.sight_signs import blind_bins
from flownav.studies.explain.sign import Found, Lack, Picture, Sign, Trace, nothing
from flownav.studies.explain.signals import gap_near

NO_PARAMETERS = Lack("the log has no parameters of the autopilot's filter")
SURE = 4.0
NOISE_M = 12.0
REFUSED_SHARE = 0.25
UNAIDED_S, GPS_GONE_S = 4.0, 1.5
BAD_SHARE, LOOKED_S = 0.35, 12.0
FUSED_AFTER_ALL = 0.3


def deadlock(case: Case) -> Found:
    """PX4: the range is the height, so that the ground is not estimated; flow waits for it, and nothing else aids."""
    p = case.log.parameters
    if case.own_settings.dialect != PX4 or "EKF2_HGT_REF" not in p:
        return Lack("PX4 1.14 and later alone can have it") if case.own_settings.dialect != PX4 else NO_PARAMETERS
    one = case.own_settings.set_at(1)
    waits = one is not None and one.height == RANGE and one.flow and p.get("EKF2_RNG_CTRL", 1.0) >= 1.0
    gps = one is not None and one.gps and case.stream(Sensor.GPS_POSITION) is not None
    other = gps or p.get("EKF2_EV_CTRL", 0.0) > 0.0
    if case.flow is None or not waits or other:
        return nothing(case.flight_s)
    fused = case.fused_share
    if fused is not None and fused > FUSED_AFTER_ALL:
        return nothing(case.flight_s, 0.5, fused=100.0 * fused)
    sentence = "" if fused is None else f"EKF2 took the flow in {100.0 * fused:.0f} % of the flight"
    return Sign(SURE if fused is not None else 0.6 * SURE, case.flight_s, {"said": sentence}, _flow_picture(case))


def height_noise(case: Case) -> Found:
    """Finds a stated noise of the height's source so large that nothing holds the height."""
    noise = case.own_settings.height_noise_m
    if noise is None:
        return Lack("no parameter states the noise of the height's source")
    figures: dict[str, float | str] = {"noise_m": noise}
    pictures: tuple[Picture, ...] = ()
    if case.own is not None and case.range_height is not None:
        pictures = (Picture("height (m)", (
            Trace("truth", "range", *case.range_height),
            Trace("autopilot", "the autopilot's own", case.own.t_s, -case.own.pos_ned_m[:, 2]),
        )),)  # fmt: skip
    return Sign(noise / NOISE_M, case.flight_s, figures, pictures)


def refused(case: Case) -> Found:
    """Flow that the parameters keep out: its quality, its height or its rate lies beyond what they allow."""
    if case.flow is None:
        return Lack("no optical flow")
    t, flow = case.own_settings, case.flow
    if all(limit is None for limit in (t.least_quality, t.flow_low_m, t.flow_high_m)):
        return Lack("no parameter that states limits of the flow")
    good = flow.lifted & (flow.quality > 0.0)
    if not good.any():
        return nothing(case.flight_s)
    height = np.where(np.isfinite(flow.range_m), flow.range_m, np.nan)
    shares = {
        "quality": float(np.mean(flow.quality[good] < (t.least_quality or 0.0))),
        "too high": float(np.mean(height[good] > t.flow_high_m)) if t.flow_high_m is not None else 0.0,
        "too low": float(np.mean(height[good] < t.flow_low_m)) if t.flow_low_m is not None else 0.0,
    }
    why = max(shares, key=lambda name: shares[name])
    share = shares[why]
    if case.fused_share is not None and case.fused_share > 1.0 - 0.5 * share:
        return nothing(case.flight_s, 0.3)
    words = {
        "quality": f"its quality in flight is {np.median(flow.quality[good]):.0f} in the middle and "
                   f"{t.least_quality or 0.0:.0f} is asked for",
        "too high": f"it flew above the {t.flow_high_m or 0.0:.1f} m up to which flow is allowed",
        "too low": f"it flew below the {t.flow_low_m or 0.0:.2f} m from which flow is allowed",
    }  # fmt: skip
    figures: dict[str, float | str] = {
        "why": words[why], "which": why, "share": 100.0 * share, "quality": float(np.quantile(flow.quality[good], 0.1)),
        "height_m": float(np.nanmax(height[good])) if np.isfinite(height[good]).any() else 0.0,
    }  # fmt: skip
    label = "quality (0 to 255)" if why == "quality" else "range (m)"
    value = flow.quality if why == "quality" else height
    return Sign(
        share / REFUSED_SHARE,
        case.flight_s,
        figures,
        (Picture(label, (Trace("flow", label, flow.t_s, value, dots=True),)),),
    )


def never_switched(case: Case) -> Found:
    """No GPS for long, sound flow at hand, and the sources in use do not take it."""
    if not case.own_settings.sets:
        return NO_PARAMETERS
    if case.flow is None:
        return Lack("no optical flow")
    if not case.flew:
        return Lack("it never left the ground")
    grid = np.arange(*case.flight_s, 0.1)
    place = case.stream(Sensor.GPS_POSITION)
    without = np.ones(len(grid), bool) if place is None else gap_near(place.t_s, grid) > GPS_GONE_S
    numbers = case.source_set_at(grid)
    takes = np.zeros(len(grid), bool)
    for one in case.own_settings.sets:
        takes |= (numbers == one.number) & (one.flow or one.external)
    sound = gap_near(case.flow.t_s[case.flow.quality > 0.0], grid) < 0.5
    unaided = without & ~takes & sound
    seconds = 0.1 * float(np.count_nonzero(unaided))
    rows = np.flatnonzero(unaided)
    window = (float(grid[rows[0]]), float(grid[rows[-1]])) if len(rows) else case.flight_s
    other = next((one.number for one in case.own_settings.sets if one.flow), 0)
    switched = len(case.events_of(SOURCE_SET))
    figures: dict[str, float | str] = {"seconds": seconds, "flow_set": float(other), "switched": float(switched)}
    return Sign(seconds / UNAIDED_S, window, figures, _flow_picture(case))


def bad_switch(case: Case) -> Found:
    """Switched to flow where there was no range or nothing to see."""
    if not case.own_settings.sets:
        return NO_PARAMETERS
    switched = case.events_of(SOURCE_SET)
    if case.flow is None:
        return Lack("no optical flow")
    starts, blind = blind_bins(case, case.flow)
    worst, window = 0.0, case.flight_s
    figures: dict[str, float | str] = {}
    for k, (t_s, number) in enumerate(switched):
        one = case.own_settings.set_at(int(number))
        if one is None or not one.flow or one.gps or one.external:
            continue
        if t_s < max(case.flight_s[0], case.log.span_s[0] + 1.0):
            continue
        until = min(switched[k + 1][0] if k + 1 < len(switched) else case.flight_s[1], t_s + LOOKED_S)
        grid = np.arange(t_s, until, 0.1)
        if len(grid) < 10:
            continue
        no_range = np.ones(len(grid), bool) if case.ranges is None else gap_near(case.ranges[0], grid) > 0.6
        row = np.clip(np.searchsorted(starts, grid, side="right") - 1, 0, max(len(starts) - 1, 0))
        unseen = blind[row] if len(starts) else np.zeros(len(grid), bool)
        silent = gap_near(case.flow.t_s, grid) > 0.6
        share = float(np.mean(no_range | unseen | silent))
        if share > worst:
            worst, window = share, (t_s, until)
            why = "no valid range" if np.mean(no_range) >= np.mean(unseen | silent) else "nothing for the flow to see"
            figures = {"share": 100.0 * share, "why": why, "set": float(number), "at_s": t_s}
    return Sign(worst / BAD_SHARE, window, figures, _flow_picture(case))


def _flow_picture(case: Case) -> tuple[Picture, ...]:
    if case.flow is None:
        return ()
    traces = [Trace("flow", "quality of the flow / 100", case.flow.t_s, case.flow.quality / 100.0, dots=True)]
    if case.ranges is not None:
        traces.append(Trace("truth", "range (m)", *case.ranges, dots=True))
    place = case.stream(Sensor.GPS_POSITION)
    if place is not None:
        traces.append(Trace("gps", "GPS received", place.t_s, np.zeros(len(place)), dots=True))
    return (Picture("what there was to go by", tuple(traces)),)
