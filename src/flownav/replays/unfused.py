"""Horizontal sensors that a log has, and of which hardly a reading was fused."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import numpy as np

from flownav.core.measurement import Array, Sensor, Stream
from flownav.estimation.gating import Reason
from flownav.navigation.reasons import HORIZONTAL, REFUSALS
from flownav.navigation.rows import InnovationRow
from flownav.replays.sentinel import Finding

LEAST_READINGS = 20
LEAST_SHARE = 0.2  # a live session fuses what it heard in its first two seconds, however late
LATE = Reason.LATE.label  # what a live session's horizon left out never came to the navigator


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
            heard = f"{sensor.name.lower()} was heard and {'hardly' if fused else 'never'} fused"
            text = f"{heard} ({fused} readings; {reasons}): the estimate rests on the other sensors"
            found.append(Finding(text, unfused=True))
    return found
