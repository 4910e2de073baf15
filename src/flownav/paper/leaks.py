"""What errors of the sensor's gyro and sonar do to the gain and delay that are identified on the rig, in sentences."""

from __future__ import annotations

import numpy as np

from flownav.lab.optics.firmware import EARLY_GYRO_SCALE
from flownav.paper.laboratory import Identified, Laboratory, identified
from flownav.paper.published import HEIGHTS_M
from flownav.paper.words import kept_together

EXACT, FLOW_OLDER, GYRO_OLDER = "exact gyro scale", "flow 20 ms older", "gyro 20 ms older"
SONARS = ("sonar at once", "sonar 150 ms late")
ByHeight = dict[float, Identified]


def leak_sentences(laboratory: Laboratory | None) -> str:
    """Of the table that `rows.instrument_rows` has; empty where it has none."""
    if laboratory is None or not laboratory.instruments:
        return ""
    found = {other.name: by_height for other, by_height in laboratory.instruments}
    as_is = {height: identified(laboratory.at(height)[0]) for height in HEIGHTS_M}
    left = [100.0 * turned_share(laboratory, height) for height in HEIGHTS_M]
    moved = max(abs(found[name][height].gain - as_is[height].gain) for name in SONARS for height in HEIGHTS_M)
    older, younger = found[FLOW_OLDER], found[GYRO_OLDER]
    return kept_together(
        "A rod turns the sensor as it moves it, and what the gyro does not take off of the turning reads as velocity. "
        f"The gyro of this firmware shows {100.0 * (1.0 - EARLY_GYRO_SCALE):.1f} % too little, which on a rod of "
        "length l at a height h adds h/l times as much: "
        f"{', '.join(f'{share:.0f}' for share in left)} % of the velocity "
        f"at the four heights. Gains are {gains(as_is)}, with an exact gyro {gains(found[EXACT])}. Where flow and gyro "
        f"are of two instants, the leak is in the delay: it is {delays(as_is)}, with the flow 20 ms the older "
        f"{delays(older)} ({trend(older)}; the paper's grows), with the gyro the older {delays(younger)} "
        f"({trend(younger)}). How late the sonar is moves the gain by {moved:.3f} at most: so small a swing hardly "
        "changes the height."
    )


def turned_share(laboratory: Laboratory, height_m: float) -> float:
    """Velocity that the gyro's scale leaves over the sensor's, by the rod's geometry: (1 - scale) h/l."""
    return (1.0 - EARLY_GYRO_SCALE) * height_m / laboratory.at(height_m)[0].log.rod_length_m


def gains(found: ByHeight) -> str:
    """By height."""
    return ", ".join(f"{found[height].gain:.2f}" for height in HEIGHTS_M)


def delays(found: ByHeight) -> str:
    """By height, with the unit."""
    return ", ".join(f"{1e3 * found[height].delay_s:.0f}" for height in HEIGHTS_M) + " ms"


def trend(found: ByHeight) -> str:
    """Whether a delay grows or falls with height."""
    steps = np.diff([found[height].delay_s for height in HEIGHTS_M])
    if (steps > 0.0).all():
        return "growing with height"
    return "falling with height" if (steps < 0.0).all() else "neither growing nor falling with height"
