"""What a first look at flow, reference and range makes a warning."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flownav.core.measurement import Sensor
from flownav.lab.identification.first_look import IN_PART, Look
from flownav.lab.identification.usable import jumps
from flownav.logs.log import Log
from flownav.replays.judged import flying_at
from flownav.replays.sentinel import Finding

LEAST_JUMPING = 0.01  # of the steps in flight: of less, one echo is no trouble


def told_of(log: Log, look: Look | None, found: Sequence[Finding]) -> list[Finding]:
    """Warnings beside those found: the flow's axes, unless they are told already, and a range that jumps."""
    told = []
    if look is not None and look.clear and not look.right and not any(finding.flow_is_wrong for finding in found):
        sure = look.correlation >= IN_PART
        told += [Finding(f"flow: {look.axes}, against {look.against}; mend the log's flow columns", True)] * sure
    return [*told, *_of_range(log)]


def _of_range(log: Log) -> list[Finding]:
    if Sensor.RANGE not in log.streams:
        return []
    stream = log.streams[Sensor.RANGE]
    aloft = flying_at(log, stream.t_s - stream.delay_s) & (stream.value[:, 0] > 0.0)
    t_s, range_m = stream.t_s[aloft], stream.value[aloft, 0]
    share, doubt = jumps(t_s, range_m)
    if share < LEAST_JUMPING:
        return []
    largest = float(np.abs(np.diff(range_m)).max())
    return [
        Finding(
            f"range jumps in {share:.0%} of its steps in flight, by up to {largest:.1f} m: velocities from flow and "
            f"range are off by {doubt:.0%} or so"
        )
    ]
