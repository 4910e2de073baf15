"""A made flight: its definition, its seeds, and the CSV folder that it is written as (docs/reference/csv-folder.md)."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Table = dict[str, Array]

TRUTH_HZ, HEADING_HZ = 200, 50
TRUTH_NOISE_M = 0.0007  # of a motion capture: as in the logs of this class
GRAVITY_M_S2 = 9.80665


class Truth(NamedTuple):
    """The true motion at every instant of one fixed step.

    t_s (n,); pos_ned_m, vel_ned_m_s (n, 3) of the IMU, from where it stood at first; quaternion (n, 4) body FRD to NED,
    w first. rate_frd_rad_s, force_frd_m_s2 (n - 1, 3): the readings of perfect gyros and accelerometers, each the mean
    over the step that follows t_s. take_off_s, landing_s: the first and the last instant at which it flies.
    """

    t_s: Array
    pos_ned_m: Array
    vel_ned_m_s: Array
    quaternion: Array
    rate_frd_rad_s: Array
    force_frd_m_s2: Array
    take_off_s: float
    landing_s: float


class Made(NamedTuple):
    """A made flight: its class and number, the tables of its CSV folder by file, and what was so."""

    name: str
    number: int
    tables: dict[str, Table]
    truth: Truth


def draws(name: str, number: int, what: str) -> np.random.Generator:
    """The random numbers of one flight for one purpose: the same for the same words, independent for others."""
    digest = hashlib.sha256(f"{name}/{number}/{what}".encode()).digest()
    return np.random.Generator(np.random.Philox(key=int.from_bytes(digest[:16], "little")))


def truth_tables(truth: Truth, random: np.random.Generator) -> dict[str, Table]:
    """truth.csv with a motion capture's noise, and heading_truth.csv."""
    step_s = truth.t_s[1] - truth.t_s[0]
    rows = np.arange(0, len(truth.t_s), round(1.0 / (TRUTH_HZ * step_s)))
    place = truth.pos_ned_m[rows] + TRUTH_NOISE_M * random.standard_normal((len(rows), 3))
    fewer = np.arange(0, len(truth.t_s), round(1.0 / (HEADING_HZ * step_s)))
    return {
        "truth": {"t_s": truth.t_s[rows], **{f"{axis}_m": column for axis, column in zip("xyz", place.T, strict=True)}},
        "heading_truth": {"t_s": truth.t_s[fewer], "yaw_rad": np.unwrap(heading_of(truth.quaternion[fewer]))},
    }


def heading_of(quaternion: Array) -> Array:
    """Euler's yaw [rad] (n,) of quaternions (n, 4), body FRD to NED."""
    w, x, y, z = quaternion.T
    return np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def into_body(quaternion: Array, vector: Array) -> Array:
    """Vectors of the earth (n, 3) in the body's axes."""
    axis, w = -quaternion[:, 1:], quaternion[:, :1]
    twice = 2.0 * np.cross(axis, vector)
    return vector + w * twice + np.cross(axis, twice)


def write(made: Made, folder: Path) -> None:
    """Write the flight as a CSV folder, which is made where it is missing; to a micro-unit, as a logger would."""
    import pyarrow as pa
    from pyarrow import csv

    folder.mkdir(parents=True, exist_ok=True)
    for name, table in made.tables.items():
        rounded = {column: np.round(values, 6) for column, values in table.items()}
        csv.write_csv(pa.table(rounded), folder / f"{name}.csv", csv.WriteOptions(quoting_style="none"))
