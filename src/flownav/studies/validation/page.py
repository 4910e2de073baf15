"""docs/explanation/validation.md: the meaning of the figures for the simulator, in words and as a page without a
date.
"""

from collections.abc import Sequence

from flownav.core.version import __version__
from flownav.simulation.dispersion import DispersionSection
from flownav.studies.validation.job import SLACK, Row

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
    ("range_beyond_reach", "A range sensor that receives no echo stays silent in the simulator; the recorded ones go "
     "on reporting something near. That is a change of the sensor's equation and not made."),
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


def sentences_of(rows: Sequence[Row], verdict: str) -> list[str]:
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
    """The effects that the simulator lacks, by the figure's name."""
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
    """The counts of the verdicts, in one sentence."""
    counts = {
        verdict: sum(row.verdict == verdict for row in rows) for verdict in ("as flown", TOO_KIND, TOO_HARD, OTHER)
    }
    return (
        f"Of {len(rows)} figures {counts['as flown']} are as flown; the simulator is too kind in {counts[TOO_KIND]}, "
        f"too hard in {counts[TOO_HARD]}, and neither but different in {counts[OTHER]}."
    )


# -- the page ----------------------------------------------------------------------------------------------------
HEAD = """# Validated against flights

Is the simulator as hard as the real world? `flownav validate` takes recorded flights, lets simulated sensors fly
the same paths, runs the same navigator on both, and sets the figures beside each other. Printed by `make validate`
(`flownav validate --flights {count} --seed {seed} --out docs/explanation/validation.md`) with flownav {version}.

## How

- **Path.** The smoothed estimate of the navigator on the log, below {bandwidth:g} Hz, height over the ground that
  the range sensor saw. Attitude, rates and specific force follow from it as a multirotor's do: thrust along body
  -z, rotor drag and mean wind as the log's accelerometer shows them (least squares), heading as recorded.
- **Sensors.** The shipped datasheets, dispersed by the shipped
  [dispersion](../reference/scenarios.md#matched-and-ensemble), at
  the log's own instants and of its own kinds: flow camera (without gyro where the log has none), IMU (one of two or
  three readings of a unit of 100 Hz and more), receiver (in the log's steps), lidar where the log reads below 0.25
  m and else sonar, barometer, compass, and an autopilot's attitude with the errors of the paper's GPS/INS. Who is
  who is drawn by (seed, flight).
- **Navigator.** `flownav replay` as it is shipped, with no knowledge of either, with the GPS outages of
  `src/flownav/data/validation.toml`, each a replay of its own, with flow and without.
- **Verdict.** *As flown*: the recorded figure is not more than {slack:g} times beyond the least and largest of the
  simulated flights. *Too kind*: it is worse than that; *too hard*: it is better. The exit status is 1 where the
  drift with flow is too kind.

What is not simulated: gusts and control faster than the path, terrain, wind that changes, texture, and what the
autopilots did to their logs. The path is an estimate, so that its own errors are in both columns.

"""


ASTRAY_WORDS = (
    "Here the navigator lost its way on plausible sensors although it had flow: a finding about the navigator that no "
    "recorded flight shows. `heading_refuted_times` says whether it gave up a heading that was right, after which flow "
    "cannot help."
)


def page(rows: Sequence[Row], seed: int, count: int, bandwidth_hz: float) -> str:
    """The whole page."""
    text = HEAD.format(version=__version__, seed=seed, count=count, bandwidth=bandwidth_hz, slack=SLACK)
    text += f"## What comes out\n\n{verdicts(rows)} Outages first; simulated: median, least and largest of {count} "
    text += "flights.\n\n"
    text += table([row for row in rows if row.figure.startswith("outage")])
    for title, verdict in (
        ("Where the simulator is too kind", TOO_KIND),
        ("Where it is too hard", TOO_HARD),
        ("Where it is different", OTHER),
    ):
        sentences = sentences_of(rows, verdict)
        if sentences:
            text += f"\n## {title}\n\n" + "".join(f"- {sentence}\n" for sentence in sentences)
    lost = astray(rows)
    if lost:
        text += f"\n## Simulated flights that went astray\n\n{ASTRAY_WORDS}\n\n" + "".join(f"- {one}\n" for one in lost)
    text += "\n## What was widened from the logs\n\n| number | drawn from | why |\n|---|---|---|\n"
    text += "".join(f"| `{name}` | {drawn} | {source} |\n" for name, drawn, source in widened())
    text += "\n## The figures\n\n| figure | what it is |\n|---|---|\n"
    text += "".join(f"| `{name}` | {meaning} |\n" for name, meaning in MEANINGS)
    for log in dict.fromkeys(row.log for row in rows):
        text += f"\n### {log}\n\n" + table([row for row in rows if row.log == log], with_log=False)
    return text


def table(rows: Sequence[Row], *, with_log: bool = True) -> str:
    """Rows as a table of Markdown."""
    first = "| log " if with_log else ""
    text = (
        f"{first}| figure | flown | simulated | least | largest | |\n"
        + ("|---" if with_log else "")
        + "|---|---|---|---|---|---|\n"
    )
    for row in rows:
        cells = (number(value) for value in (row.flown, row.simulated, row.low, row.high))
        text += (f"| {row.log} " if with_log else "") + f"| `{row.figure}` | {' | '.join(cells)} | {row.verdict} |\n"
    return text
