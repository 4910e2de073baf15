"""Table: one table of a record, a dictionary of NumPy columns that becomes a data frame when asked."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from flownav.core.errors import InputError
from flownav.core.record import Column

if TYPE_CHECKING:
    import pandas
    import polars
    import xarray

FRAMES = 'python -m pip install "flownav[frames]"'

# units as columns' names end in them, the longest first, and as SI writes them
UNITS = (
    ("_m_s2_rt_hz", "m/s2/sqrt(Hz)"), ("_rad_s2", "rad/s2"), ("_rad_s", "rad/s"), ("_deg_s", "deg/s"),
    ("_m_s2", "m/s2"), ("_m_s", "m/s"), ("_gauss", "gauss"), ("_percent", "%"), ("_rad", "rad"), ("_deg", "deg"),
    ("_hz", "Hz"), ("_kg", "kg"), ("_m2", "m2"), ("_n", "N"), ("_m", "m"), ("_s", "s"), ("_v", "V"), ("_w", "W"),
    ("_a", "A"),
)  # fmt: skip
NO_UNIT = re.compile(r"q[wxyz]|sensor|component|source|kind|detail|reason|tan_.*")


def unit_of(column: str) -> str:
    """The unit that a column's name ends in; "" where it has none ("pos_n_m" is m, "qw" has none)."""
    if NO_UNIT.fullmatch(column):
        return ""
    return next((unit for suffix, unit in UNITS if column.endswith(suffix)), "")


class Table(dict[str, Column]):
    """A table: column names, with units in them, to NumPy arrays of equal length; `t_s` [s] is always there.

    Example:
        >>> import flownav
        >>> estimate = flownav.fly("landing", flight={"duration_s": 6.0}).estimate
        >>> bool(estimate["pos_n_m"].shape == estimate["t_s"].shape)
        True
    """

    def __init__(self, columns: Any, name: str = "table") -> None:
        try:
            super().__init__(columns)
        except (TypeError, ValueError):
            raise InputError(f"columns: {type(columns).__name__} is given; a mapping by names is needed") from None
        self.name = name

    def __missing__(self, column: str) -> Column:
        raise KeyError(f"{self.name} has no column {column!r}; it has: {', '.join(self)}")

    def __repr__(self) -> str:
        return f"<Table {self.name}: {len(self)} columns, {self.rows} rows: {', '.join(self)}>"

    @property
    def rows(self) -> int:
        """How many rows it has.

        Example:
            >>> record = flownav.fly("landing", flight={"duration_s": 6.0})
            >>> record.truth.rows
            301
        """
        return len(next(iter(self.values()), ()))

    def units(self) -> dict[str, str]:
        """Each column's unit, read from its name; "" for a column without one.

        Example:
            >>> flownav.fly("landing", flight={"duration_s": 6.0}).truth.units()["vel_u_m_s"]
            'm/s'
        """
        return {column: unit_of(column) for column in self}

    def to_pandas(self) -> pandas.DataFrame:
        """The table as a pandas data frame, indexed by t_s. InputError where pandas is not installed.

        Example:
            >>> frame = flownav.fly("landing", flight={"duration_s": 6.0}).estimate.to_pandas()
            >>> frame.index.name
            't_s'
        """
        made = library("pandas")
        found: pandas.DataFrame = made.DataFrame(dict(self)).set_index("t_s")
        return found

    def to_xarray(self) -> xarray.Dataset:
        """The table as an xarray data set: dimension t_s, a unit as `units` of every variable that has one.

        InputError where xarray is not installed.

        Example:
            >>> estimate = flownav.fly("landing", flight={"duration_s": 6.0}).estimate.to_xarray()
            >>> estimate.pos_n_m.attrs["units"]
            'm'
        """
        made, units = library("xarray"), self.units()
        columns = {
            column: ("t_s", values, {"units": units[column]} if units[column] else {})
            for column, values in self.items()
            if column != "t_s"
        }
        time = ("t_s", self["t_s"], {"units": "s"})
        found: xarray.Dataset = made.Dataset(columns, {"t_s": time}, {"title": self.name})
        return found

    def to_polars(self) -> polars.DataFrame:
        """The table as a polars data frame, t_s its first column. InputError where polars is not installed.

        Example:
            >>> flownav.fly("landing", flight={"duration_s": 6.0}).estimate.to_polars().columns[0]
            't_s'
        """
        made = library("polars")
        found: polars.DataFrame = made.DataFrame({"t_s": self["t_s"], **self})
        return found


def library(name: str) -> Any:
    """A data-frame library. InputError where it is not installed."""
    from importlib import import_module

    try:
        return import_module(name)
    except ImportError:
        raise InputError(f"{name} is not installed; {FRAMES} installs it") from None
