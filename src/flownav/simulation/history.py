"""The history of a block of flights: one row of columns an epoch, from which scores and records are made."""

import numpy as np
from numpy.typing import NDArray

from flownav.control.guidance import Reference
from flownav.core.compile import Lanes, Work, equation
from flownav.core.frames import rotation_from_quaternion, to_earth
from flownav.core.record import POSITION_NED, QUATERNION, TABLES, VELOCITY_BODY
from flownav.estimation.paper_filter import STATES
from flownav.sensors.geometry import ground_height
from flownav.simulation import layout
from flownav.simulation.layout import PLANT, ground_as_is, load_autopilot, load_helicopter
from flownav.simulation.records import Spread

load_spread, _ = PLANT.access(Spread)

# columns and the rows of the lane buffer that they copy
_COPIED: tuple[tuple[str, tuple[str, ...], int], ...] = (
    ("truth", (*POSITION_NED, *VELOCITY_BODY, *QUATERNION, *TABLES["truth"][10:13]), layout.HELICOPTER),
    ("truth", ("thrust_n", "contact_n"), layout.LOADS),
    ("estimate", (*POSITION_NED, *VELOCITY_BODY, *QUATERNION), layout.ESTIMATED),
    ("estimate", ("nees",), layout.NEES),
    ("gps", ("pos_n_m", "pos_e_m", "pos_d_m", "vel_n_m_s", "vel_e_m_s", "vel_d_m_s", *QUATERNION), layout.GPS),
    ("flow", VELOCITY_BODY, layout.FLOW_READING),
    ("flow", ("engaged",), layout.SEES_FLOW),
    ("flow", ("sigma_m_s",), layout.FLOW_READING + 3),
    ("measured", (*POSITION_NED, *VELOCITY_BODY), layout.MEASURED),
    ("measured", ("velocity_arrived",), layout.ARRIVED + 3),
    ("range", ("range_m", "valid"), layout.RANGE),
    ("horizon", tuple(f"error_{name}" for name in (*POSITION_NED, *VELOCITY_BODY)), layout.HORIZON_ERROR),
    ("innovation", tuple(f"innovation_{i}" for i in range(STATES)), layout.INNOVATION),
    ("innovation", tuple(f"innovation_variance_{i}" for i in range(STATES)), layout.INNOVATION + STATES),
    ("command", ("lon_rad", "lat_rad", "col_rad", "ped_rad"), layout.CONTROLS),
)  # fmt: skip
_COMPUTED = (
    *(("estimate", f"std_{name}") for name in (*POSITION_NED, *VELOCITY_BODY)),
    ("command", "pos_n_ref_m"),
    ("command", "pos_e_ref_m"),
    ("command", "pos_d_ref_m"),
    ("autopilot", "flying"),
    ("autopilot", "away"),
    ("truth", "sink_rate_m_s"),
    ("truth", "ground_m"),
)
HISTORY: tuple[tuple[str, str], ...] = (
    *((table, name) for table, names, _ in _COPIED for name in names),
    *_COMPUTED,
)
_SOURCE_ROWS = np.array([row + i for _, names, row in _COPIED for i in range(len(names))], np.int64)
COPIED = len(_SOURCE_ROWS)


def column(table: str, name: str) -> int:
    """The index of a history column."""
    return HISTORY.index((table, name))


def columns(table: str, names: tuple[str, ...]) -> slice:
    """The indices of consecutive history columns."""
    first = column(table, names[0])
    return slice(first, first + len(names))


@equation
def write_history(work: Work, lanes: Lanes, epoch: int, reference: Reference, history: NDArray[np.float64]) -> None:
    """One epoch of every lane into history (epochs, len(HISTORY), lanes)."""
    for k in range(COPIED):
        row = _SOURCE_ROWS[k]
        for lane in range(len(lanes)):
            history[epoch, k, lane] = work[row * len(lanes) + lane]
    for lane in range(len(lanes)):
        spread = load_spread(work, lanes, lane)
        for i in range(STATES):
            history[epoch, COPIED + i, lane] = np.sqrt(max(spread[i], 0.0))
        history[epoch, COPIED + 6, lane] = reference.pos_n
        history[epoch, COPIED + 7, lane] = reference.pos_e
        history[epoch, COPIED + 8, lane] = reference.pos_d
        autopilot = load_autopilot(work, lanes, lane)
        history[epoch, COPIED + 9, lane] = autopilot.flying
        history[epoch, COPIED + 10, lane] = autopilot.away
        state = load_helicopter(work, lanes, lane)
        rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
        history[epoch, COPIED + 11, lane] = to_earth(rotation, state.u, state.v, state.w)[2]
        ground_m = ground_height(state.pos_n, state.pos_e, ground_as_is(work, lanes, lane))
        history[epoch, COPIED + 12, lane] = ground_m
