"""The paths of a record as poses, in NED/FRD or in ENU/FLU, and the estimate's error where the record holds a truth."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError
from flownav.core.frames import quaternion_product, rotation_from_quaternion, to_earth
from flownav.core.measurement import Array
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY, Record, Table

PATHS = ("estimate", "smoothed", "truth", "autopilot")
FRAMES = ("ned", "enu")
ENU_FROM_NED = (0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0)  # swaps north and east, turns down up
FRD_FROM_FLU = (0.0, 1.0, 0.0, 0.0)  # half a turn about forward
SIGMAS = 3.0
ERROR = ("error_n_m", "error_e_m", "error_d_m")
BOUND = ("three_sigma_n_m", "three_sigma_e_m", "three_sigma_d_m")


class Trajectory(NamedTuple):
    """A path, rows in order of time.

    name: of PATHS. t_s (n,); position_m (n, 3) in the earth frame; quaternion (n, 4)
    w, x, y, z, body to earth; velocity_m_s (n, 3) in the earth frame, None where the record cannot tell;
    oriented: False where no attitude was recorded and `quaternion` is level, facing north; row (n,): which row
    of the record's table each is; left_out: how many rows had no finite time, position or attitude.
    """

    name: str
    t_s: Array
    position_m: Array
    quaternion: Array
    velocity_m_s: Array | None
    oriented: bool
    row: NDArray[np.int64]
    left_out: int

    @property
    def notes(self) -> Iterator[str]:
        """What a user should know of this path, one line each."""
        if self.left_out:
            yield f"{self.name}: {self.left_out} of {self.left_out + len(self.t_s)} rows left out, not finite"
        if not self.oriented:
            yield f"{self.name}: no attitude recorded, level and facing north written; compare positions only"


def trajectories(record: Record, frame: str = "ned") -> list[Trajectory]:
    """Every path that the record holds, in NED/FRD or (`frame` "enu") in ENU/FLU. InputError without any."""
    found = [path for name in PATHS if (path := _trajectory(record, name)) is not None]
    if not found:
        raise InputError(f"the record holds no path (no finite position in {', '.join(PATHS)})")
    return found if frame == "ned" else [in_enu(path) for path in found]


def in_enu(path: Trajectory) -> Trajectory:
    """A path of NED/FRD in ENU/FLU: the earth's axes and the body's are both exchanged."""

    def turned(vector: Array) -> Array:
        return vector[:, [1, 0, 2]] * (1.0, 1.0, -1.0)

    from_frd = quaternion_product(ENU_FROM_NED, tuple(path.quaternion.T))
    return path._replace(
        position_m=turned(path.position_m),
        quaternion=np.column_stack(quaternion_product(from_frd, FRD_FROM_FLU)),
        velocity_m_s=None if path.velocity_m_s is None else turned(path.velocity_m_s),
    )


def _trajectory(record: Record, name: str) -> Trajectory | None:
    table = record.tables.get(name, {})
    if not {"t_s", *POSITION_NED} <= table.keys():
        return None
    t_s = np.asarray(table["t_s"], float)
    position = record.matrix(name, POSITION_NED)
    usable = np.isfinite(t_s) & np.isfinite(position).all(axis=1)
    quaternion = record.matrix(name, QUATERNION) if set(QUATERNION) <= table.keys() else np.full((len(t_s), 4), np.nan)
    attitude = np.isfinite(quaternion).all(axis=1) & (np.abs(quaternion).max(axis=1, initial=0.0) > 0.0)
    oriented = bool((usable & attitude).any())
    if oriented:
        usable &= attitude
    else:
        quaternion = np.tile((1.0, 0.0, 0.0, 0.0), (len(t_s), 1))
    row = np.flatnonzero(usable)
    row = row[np.argsort(t_s[row], kind="stable")]
    if not len(row):
        return None
    unit = quaternion[row] / np.linalg.norm(quaternion[row], axis=1, keepdims=True)
    velocity = None
    if oriented and set(VELOCITY_BODY) <= table.keys():
        body = record.matrix(name, VELOCITY_BODY)[row]
        velocity = np.column_stack(to_earth(rotation_from_quaternion(*unit.T), *body.T))
    return Trajectory(name, t_s[row], position[row], unit, velocity, oriented, row, int(len(t_s) - len(row)))


def error_table(record: Record, paths: list[Trajectory]) -> Table | None:
    """Estimate less truth [m] at the estimate's instants inside the truth's time, and three standard deviations.

    Columns t_s, ERROR, and BOUND where the record states them. None without an estimate, a truth, or an instant that
    both have.
    """
    named = {path.name: path for path in paths}
    if not {"estimate", "truth"} <= named.keys():
        return None
    estimate, truth = named["estimate"], named["truth"]
    inside = (estimate.t_s >= truth.t_s[0]) & (estimate.t_s <= truth.t_s[-1])
    if not inside.any():
        return None
    t_s = estimate.t_s[inside]
    table: Table = {"t_s": t_s}
    for k, name in enumerate(ERROR):
        table[name] = estimate.position_m[inside, k] - np.interp(t_s, truth.t_s, truth.position_m[:, k])
    columns = tuple(f"std_{name}" for name in POSITION_NED)
    if set(columns) <= record.tables["estimate"].keys():
        spread = record.matrix("estimate", columns)[estimate.row][inside]
        table |= {name: SIGMAS * spread[:, k] for k, name in enumerate(BOUND)}
    return table
