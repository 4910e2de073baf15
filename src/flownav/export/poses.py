"""TUM and EuRoC files, a path each: what evo and the visual-inertial world compare trajectories with.

TUM: `t x y z qx qy qz qw`, seconds and metres, comment lines begin with #
(Sturm et al. 2012, file formats of the RGB-D benchmark).
EuRoC: comma-separated, nanoseconds, position, quaternion w first, velocity (Burri et al. 2016,
state_groundtruth_estimate0). Its bias columns are left out, header and all: no figure is made up.
"""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import numpy as np

from flownav.core.guard import written_whole
from flownav.core.record import Record
from flownav.export.stamps import stamps
from flownav.export.trajectory import Trajectory, trajectories

AXES = {"ned": "earth NED, body FRD", "enu": "earth ENU, body FLU"}
EUROC_POSE = (
    *("#timestamp [ns]", "p_RS_R_x [m]", "p_RS_R_y [m]", "p_RS_R_z [m]"),
    *("q_RS_w []", "q_RS_x []", "q_RS_y []", "q_RS_z []"),
)
EUROC_VELOCITY = ("v_RS_R_x [m s^-1]", "v_RS_R_y [m s^-1]", "v_RS_R_z [m s^-1]")


def tum_text(path: Trajectory, frame: str) -> str:
    """A path as a TUM file, whose first line states its frame."""
    lines = [f"# flownav {path.name}; {AXES[frame]}; t_s x y z qx qy qz qw"]
    rows = np.column_stack([path.t_s, path.position_m, path.quaternion[:, [1, 2, 3, 0]]])
    lines += [" ".join(f"{value:.9f}" for value in row) for row in rows.tolist()]
    return "\n".join(lines) + "\n"


def euroc_text(path: Trajectory, frame: str) -> str:
    """A path as EuRoC CSV; without velocity columns where the path has none. The format has no place for the frame."""
    names, columns = list(EUROC_POSE), [path.position_m, path.quaternion]
    if path.velocity_m_s is not None:
        names, columns = [*names, *EUROC_VELOCITY], [*columns, path.velocity_m_s]
    rows = np.column_stack(columns).tolist()
    times = stamps(path.t_s, 1e9).tolist()
    lines = [f"{t}," + ",".join(f"{value:.9f}" for value in row) for t, row in zip(times, rows, strict=True)]
    return "\n".join([",".join(names), *lines]) + "\n"


TEXTS = {".tum": tum_text, ".csv": euroc_text}


def write_poses(record: Record, path: Path, frame: str) -> tuple[list[Path], list[str]]:
    """Write each path of the record beside `path`, NAME_estimate and so on, all or none; the files and notes.

    The suffix of `path` says the format: .tum or .csv (EuRoC). InputError where the record holds no path.
    """
    paths = trajectories(record, frame)
    files = [path.with_name(f"{path.stem}_{one.name}{path.suffix}") for one in paths]
    with ExitStack() as stack:
        for one, file in zip(paths, files, strict=True):
            stack.enter_context(written_whole(file)).write_text(
                TEXTS[path.suffix](one, frame), encoding="utf-8", errors="backslashreplace"
            )
    return files, [note for one in paths for note in one.notes]
