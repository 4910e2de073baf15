"""What the figures are, in words, and what a difference says of the simulator."""

from __future__ import annotations

from collections.abc import Sequence

from flownav.simulation.dispersion import DispersionSection
from flownav.studies.validation.job import Row

TOO_KIND, TOO_HARD, OTHER = "too kind", "too hard", "other than flown"
ASTRAY, LEAST_ASTRAY_M = 5.0, 20.0  # times the recorded drift, and in all: the navigator lost its way
PROVENANCE = "flownav validate"  # what the source of an entry of the dispersion names that was widened from the logs

MEANINGS = (
    ("outage_median_m", "median drift of the 60 s outages with flow"),
    ("outage_worst_m", "worst drift with flow"),
    ("outage_median_no_flow_m", "median drift without flow"),
    ("outage_worst_no_flow_m", "worst drift without flow"),
    ("*_nis_per_dof", "innovation squared over its stated variance"),
    ("*_white", "1 where innovations are white (navigator.md)"),
    ("*_lag_one", "autocorrelation of neighbouring innovations"),
    ("*_slow_share", "share of the innovations' power below a tenth of the Nyquist frequency; 0.1 of white noise"),
    ("heading_refuted_times", "how often the navigator called its heading refuted in the whole flight, GPS on"),
    ("flow_gain", "flow over smoothed velocity, 0.5 to 4 m high"),
    ("flow_lag_s", "by how much the flow lags behind the smoothed velocity"),
    ("flow_noise_rad_s", "what gain and lag leave of the flow, robust standard deviation"),
    ("flow_noise_lag_one", "its autocorrelation"),
    ("flow_blind_share", "share of readings of quality 0 in flight"),
    ("range_outlier_share", "share of ranges more than 0.3 m from the smoothed height, 0.5 to 4 m high"),
    ("range_outlier_run", "length of a run of such outliers"),
    ("range_noise_m", "noise of the other ranges"),
    ("range_beyond_reach_hz", "ranges a second from above 6 m, where there is no echo"),
    ("baro_error_m", "barometer from the smoothed altitude, what changes within a minute"),
    ("baro_error_lasts_s", "time constant of that error"),
    ("gyro_*_rad_s, accel_*_m_s2", "rms of an axis in flight in a band of the spectrum"),
)

# by the beginning of a figure's name: what the simulator lacks where it is too kind
LACKS = (
    ("range_beyond_reach", "A range sensor that hears no echo stays silent in the simulator; the recorded ones go on "
     "reporting something near. That is a change of the sensor's equation and not made."),
    ("range_outlier", "Recorded outliers are more frequent and come in runs; the simulated echoes are single."),
    ("range", "In flight, ranges have outliers and correlated errors; in the simulator they are cleaner."),
    ("baro", "The barometer's error is one of seconds, by wash and gusts; the simulated one is white noise on a slow "
     "drift."),
    ("accel_above", "Vibration is broad-band in the logs; the simulator has two tones and the datasheet's noise."),
    ("gyro_above", "The vehicle itself turns faster than the path's bandwidth, which the simulated one cannot."),
    ("gyro", "The vehicle itself turns more than the smoothed path shows."),
    ("accel", "Vibration and gusts shake the recorded vehicles more than the smoothed path."),
    ("mag", "Errors of a recorded compass turn with the heading and last; the simulated ones are hard iron and noise."),
    ("gps_velocity", "A receiver's velocity lags and errs with the vehicle's speed; the simulated lag is short."),
    ("gps_position", "The errors of a recorded receiver have other time constants than the simulated ones."),
    ("flow", "Recorded flow is noisier than the sensor file states, or its errors last longer."),
    ("attitude", "The error of an autopilot's attitude comes from its own filter, which is not simulated."),
    ("outage", "The navigator drifts farther on the recorded flight than on any simulated one."),
)  # fmt: skip


def said(rows: Sequence[Row], verdict: str) -> list[str]:
    """One sentence for each figure with this verdict: the numbers of every log where it holds."""
    sentences = []
    for figure in dict.fromkeys(row.figure for row in rows):
        found = [row for row in rows if row.figure == figure and row.verdict == verdict]
        if found:
            each = "; ".join(
                f"{number(r.flown)} ({r.log}), simulated {number(r.low)} to {number(r.high)}" for r in found
            )
            cause = f" {lacking(figure)}" if verdict == TOO_KIND else ""
            sentences.append(f"`{figure}`: {each}.{cause}")
    return sentences


def astray(rows: Sequence[Row]) -> list[str]:
    """Outages with flow in which a simulated flight drifted far more than the recorded one: the navigator's doing."""
    return [
        f"{row.log}: `{row.figure}` up to {number(row.high)} m in the simulated flights, {number(row.flown)} m flown."
        for row in rows
        if row.decides and row.flown is not None and row.high is not None
        if row.high > max(ASTRAY * row.flown, LEAST_ASTRAY_M)
    ]


def lacking(figure: str) -> str:
    """What the simulator lacks, by the figure's name."""
    return next((words for beginning, words in LACKS if figure.startswith(beginning)), "")


def widened() -> list[tuple[str, str, str]]:
    """Entries of the shipped dispersion that the logs widened: name, distribution, source."""
    found = []
    for name, entry in DispersionSection().entries().items():
        if PROVENANCE in entry.source:
            shape = ", ".join(f"{key} = {value:g}" for key, value in entry.shapes.items())
            drawn = f"{entry.distribution}({shape}{', ' if shape else ''}loc = {entry.loc:g}, scale = {entry.scale:g})"
            found.append((name, f"{drawn}, {entry.mode}", entry.source))
    return found


def number(value: float | None) -> str:
    """A figure with three digits that count; - where unknown."""
    if value is None:
        return "-"
    return f"{value:.3g}" if abs(value) < 100.0 else f"{value:.0f}"


def verdicts(rows: Sequence[Row]) -> str:
    """How many figures say what, in one sentence."""
    counts = {
        verdict: sum(row.verdict == verdict for row in rows) for verdict in ("as flown", TOO_KIND, TOO_HARD, OTHER)
    }
    return (
        f"Of {len(rows)} figures {counts['as flown']} are as flown; the simulator is too kind in {counts[TOO_KIND]}, "
        f"too hard in {counts[TOO_HARD]}, and neither but different in {counts[OTHER]}."
    )
