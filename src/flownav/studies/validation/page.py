"""docs/explanation/validation.md: the validation as a page of Markdown that bears a version and no date."""

from __future__ import annotations

from collections.abc import Sequence

from flownav.core.version import __version__
from flownav.studies.validation.job import SLACK, Row
from flownav.studies.validation.words import (
    MEANINGS,
    OTHER,
    TOO_HARD,
    TOO_KIND,
    astray,
    number,
    said,
    verdicts,
    widened,
)

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
- **Navigator.** `flownav replay` as it is shipped, told nothing of either, with the GPS outages of
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
        sentences = said(rows, verdict)
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
