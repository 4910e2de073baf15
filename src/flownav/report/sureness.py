"""How sure the navigator was of its place over the pad, as the record has it."""

import numpy as np

from flownav.core.measurement import Array, Sensor
from flownav.core.record import POSITION_NED, QUATERNION, Record, mapping
from flownav.report.figures_innovation import innovation_table
from flownav.report.series import euler_deg, has, readings, track

STD_POSITION = tuple(f"std_{name}" for name in POSITION_NED)
LOOK = ("tan_forward", "tan_right", "distance_m")
LASTS_S = 1.0  # so long after a pad fix its variance is shown


def three_sigma(record: Record, t_s: Array) -> Array:
    """Three standard deviations of the place over the pad at these instants, NED [m], (n, 3); NaN where unknown.

    Of a record with pad fixes: of the vehicle against the pad, as the filter expected each fix (innovation variance
    less the reading's own). Of one without: of the position that the filter states.
    """
    seen = _against_the_pad(record)
    if seen is not None:
        fix_s, sigma = seen
        near = np.array([float(np.min(abs(fix_s - t))) <= LASTS_S for t in t_s], bool)
        held = np.column_stack([np.interp(t_s, fix_s, column) for column in sigma.T])
        return np.where(near[:, None], 3.0 * held, np.nan)
    stated = track(record, "estimate", STD_POSITION)
    if stated is None:
        return np.full((len(t_s), 3), np.nan)
    return 3.0 * np.column_stack([np.interp(t_s, stated.t_s, column) for column in stated.value.T])


def sure_at_touchdown_m(record: Record) -> float | None:
    """Three standard deviations of the less certain horizontal axis [m] as it touched; None where unknown."""
    contact = mapping(mapping(mapping(record.manifest.get("scores")).get("touchdown")).get("contact"))
    touch_s = contact.get("t_s")
    if not isinstance(touch_s, int | float):
        return None
    sigma = float(np.max(three_sigma(record, np.array([float(touch_s)]))[0, :2]))
    return sigma if np.isfinite(sigma) else None


def _against_the_pad(record: Record) -> tuple[Array, Array] | None:
    """Instants (n,) and standard deviations NED [m], (n, 3), of pad fixes; None of a record without."""
    parts = innovation_table(record).get("pad", {})
    pads = readings(record, Sensor.PAD) if "pad" in record.tables else None
    attitude = track(record, "estimate", QUATERNION) if has(record, "estimate") else None
    if pads is None or attitude is None or any("observation_variance" not in parts.get(name, {}) for name in LOOK):
        return None
    fix_s = parts[LOOK[0]]["t_s"]
    variance = np.column_stack(
        [
            np.interp(fix_s, one["t_s"], np.maximum(one["innovation_variance"] - one["observation_variance"], 0.0))
            for one in (parts[name] for name in LOOK)
        ]
    )
    distance = np.interp(fix_s, pads.t_s, pads.value[:, 2])
    heading = np.radians(euler_deg(attitude)[:, 2])
    turn = np.interp(fix_s, attitude.t_s, np.unwrap(heading))
    ahead, right = variance[:, :2].T * distance**2
    north, east = (np.cos(turn) ** 2, np.sin(turn) ** 2), (np.sin(turn) ** 2, np.cos(turn) ** 2)
    level = [a * ahead + b * right for a, b in (north, east)]
    return fix_s, np.sqrt(np.column_stack([*level, variance[:, 2]]))
