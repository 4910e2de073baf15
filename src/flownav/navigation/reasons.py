"""The reasons for refusing a component, as kernels write them: `estimation.gating.Reason` in plain numbers."""

from __future__ import annotations

from flownav.estimation.gating import Reason

(FUSED, INNOVATION_GATE, NO_DATA, NOT_FINITE, OUT_OF_RANGE, NO_HEIGHT, TILTED, BEFORE_START, DATUM, OUTAGE,
 DUPLICATE, LATE, STUCK, NEAR_GROUND, NOT_NEEDED, AHEAD, NO_HEADING) = map(int, Reason)  # fmt: skip
SILENT = -1  # nothing is said of this component in this lane: there was no reading, or the filter has not started
