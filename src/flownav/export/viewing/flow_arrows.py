"""What the flow sensor saw as a velocity over the ground: flow less the sensor's own turning, times the range."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.frames import velocity_from_flow
from flownav.core.record import Record

Array = NDArray[np.float64]
OLDEST_RANGE_S = 0.5  # a range that came longer ago than this says nothing of the height now


class FlowArrows(NamedTuple):
    """t_s (n,); velocity_m_s (n, 3) forward, right, down in body axes, NaN where a row has no data."""

    t_s: Array
    velocity_m_s: Array


def flow_arrows(record: Record) -> FlowArrows | None:
    """The velocity that the flow says, row by row of `flow_rate` (with its gyro and `range`) or `flow_velocity`.

    Rows of quality 0, without the sensor's gyro, or without a range of the last half second are NaN. None where the
    record holds neither table.
    """
    rate, velocity = record.tables.get("flow_rate"), record.tables.get("flow_velocity")
    if velocity is not None and {"vel_u_m_s", "vel_v_m_s"} <= velocity.keys():
        t_s = np.asarray(velocity["t_s"], float)
        body = np.column_stack([record.matrix("flow_velocity", ("vel_u_m_s", "vel_v_m_s")), np.zeros(len(t_s))])
        body[~_seen(velocity)] = np.nan
        return FlowArrows(t_s, body)
    columns = ("flow_x_rad_s", "flow_y_rad_s", "gyro_x_rad_s", "gyro_y_rad_s")
    if rate is None or not set(columns) <= rate.keys():
        return None
    t_s = np.asarray(rate["t_s"], float)
    flow_x, flow_y, gyro_x, gyro_y = record.matrix("flow_rate", columns).T
    forward, right = velocity_from_flow(flow_x - gyro_x, flow_y - gyro_y, _range_at(record, t_s))
    body = np.column_stack([forward, right, np.zeros(len(t_s))])
    body[~_seen(rate) | np.isnan(body).any(axis=1)] = np.nan
    return FlowArrows(t_s, body)


def _seen(table: dict[str, NDArray[np.generic]]) -> NDArray[np.bool_]:
    """The rows with data: quality above 0, or none stated."""
    return np.asarray(np.asarray(table.get("quality", np.ones(len(table["t_s"]))), float) > 0.0)


def _range_at(record: Record, t_s: Array) -> Array:
    """The last range before each instant [m], NaN where there is none that is fresh."""
    table = record.tables.get("range")
    if table is None or "range_m" not in table or not len(table["t_s"]):
        return np.full(len(t_s), np.nan)
    order = np.argsort(table["t_s"], kind="stable")
    heard_s, range_m = np.asarray(table["t_s"], float)[order], np.asarray(table["range_m"], float)[order]
    row = np.searchsorted(heard_s, t_s, side="right") - 1
    fresh = (row >= 0) & (t_s - heard_s[np.maximum(row, 0)] <= OLDEST_RANGE_S)
    return np.where(fresh, range_m[np.maximum(row, 0)], np.nan)
