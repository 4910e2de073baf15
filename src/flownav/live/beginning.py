"""How high a navigator is that begins in flight without GPS, as one does that was killed and started again.

It begins at 0, wherever the vehicle is; its height is the range's, above the ground below. One reading is one witness:
the range must say the same several times while the vehicle climbs or sinks, and the autopilot's own height
(LOCAL_POSITION_NED, which is asked for) must be the same. Until then nothing is sent; an autopilot that states no
height within ASKED_S leaves the range alone.
"""

import math
from collections import deque
from statistics import median

from flownav.core.measurement import Measurement
from flownav.live.answers import tilt_cosine
from flownav.live.filtering import Filtering
from flownav.navigation.loop import Running

RECENT_S = 1.0  # older words do not say where a navigator begins: chosen
READINGS, ALIKE = 5, 4  # of the range; of which ALIKE agree: chosen, one spike is left out
ALIKE_M = 0.3  # chosen, three times a range finder's noise at 8 m
SAME_M = 1.0  # the range and the autopilot's own height: chosen, what its barometer drifts by in minutes
WAITING_S = 1.0  # that a wrong range may still wait at the horizon (Options.most_horizon_s)
ANEW = "a new start"
ASKED_S = 2.0  # for the autopilot to state its height: chosen, 2 Hz are asked for


class Beginning:
    """Judges each navigator once, from when it has started.

    raised_m: the height above the ground at which it began, 0 for one that began on the ground. is_open: it is being
    judged, and nothing of it may be sent.
    """

    def __init__(self, filtering: Filtering) -> None:
        self._filtering = filtering
        self._judged: Running | None = None
        self.raised_m = 0.0
        self.is_open = self._contradicted = False
        self._since_s = self._read_s = self._agreed_s = math.nan
        self._heights_m: deque[float] = deque(maxlen=READINGS)
        self._stated_m, self._stated_s = math.nan, -math.inf  # the autopilot's own height, above its origin

    def state_height(self, height_m: float, t_s: float) -> None:
        """The autopilot's own height above its origin [m] at a time [s]."""
        self._stated_m, self._stated_s = height_m, t_s

    def watch(self, above: Measurement | None, landed: Measurement | None, t_s: float) -> str:
        """The newest range and landed state, at a time [s]; who stated the height that was found just now, "" for
        nobody, ANEW where the navigator was stopped, since it began by a range that was contradicted.
        """
        on, here_ned_m = self._filtering.running, self._filtering.here_ned_m
        if on is None or here_ned_m is None:
            self.is_open = False
            return ""
        if on is not self._judged:
            self._begin(on, t_s)
            self.is_open = self._filtering.lacks_gps and flies(above, landed, t_s)
        if not self.is_open:
            return ""
        if landed is not None and landed.value[0]:
            return self._found(here_ned_m[2], "landing")
        if above is not None and above.t_s != self._read_s:
            self._read_s = above.t_s
            sunk_m = 0.0 if self._contradicted else here_ned_m[2]
            self._heights_m.append(above.value[0] * tilt_cosine(on.work) + sunk_m)
        height_m = common(self._heights_m)
        return "" if math.isnan(height_m) else self._compared(height_m, t_s)

    def _begin(self, on: Running, t_s: float) -> None:
        self._judged, self.raised_m, self._since_s = on, 0.0, t_s
        self._heights_m.clear()
        self._contradicted = False

    def _compared(self, height_m: float, t_s: float) -> str:
        """A height of the range [m], held against the autopilot's own; as `watch` returns."""
        stated = t_s - self._stated_s <= RECENT_S
        if stated and abs(self._stated_m - height_m) > SAME_M:
            if not self._contradicted:
                self._heights_m.clear()
            self._contradicted, self._agreed_s = True, math.nan
            return ""
        if not stated and t_s - self._since_s < ASKED_S:
            return ""
        if not self._contradicted:
            return self._found(height_m, "range and autopilot" if stated else "range alone")
        self._agreed_s = t_s if math.isnan(self._agreed_s) else self._agreed_s
        if t_s - self._agreed_s < WAITING_S:
            return ""
        self._filtering.stop()  # the wrong range that it has learnt would come back as a height
        return ANEW

    def _found(self, height_m: float, by: str) -> str:
        self.raised_m, self.is_open = max(height_m, 0.0), False
        return by


def flies(above: Measurement | None, landed: Measurement | None, t_s: float) -> bool:
    """Whether the autopilot says that it flies, and a range says how high, both lately."""
    if above is None or landed is None or landed.value[0]:
        return False
    return min(above.t_s, landed.t_s) >= t_s - RECENT_S


def common(heights_m: deque[float]) -> float:
    """The height of which most readings are [m]; NaN where they do not agree, or are too few."""
    if len(heights_m) < READINGS:
        return math.nan
    middle_m = median(heights_m)
    alike = sum(abs(height_m - middle_m) <= ALIKE_M for height_m in heights_m)
    return middle_m if alike >= ALIKE else math.nan
