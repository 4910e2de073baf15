"""Dispersion of the truth from flight to flight: the `[dispersion]` of a scenario, and its draws.

Each entry names a number of the vehicle's file, of a sensor's datasheet or of the scenario's wind, and the distribution
that it is drawn from, by SciPy's name with SciPy's parameters:

    vehicle.body.mass_kg = { distribution = "truncnorm", a = -2, b = 2, scale = 0.5, mode = "uncertainty" }
    wind.from_direction_deg = { distribution = "uniform", loc = 0, scale = 360 }

`mode` states the use of the draw: it is the value, a factor on the datasheet's value, an offset to it, or a multiple of
the uncertainty that the file states beside the value (0.6, or "60..150": then of the side that it is on). Units are
those of the number's own name.

`known` states who could know the number before a flight, for the split of uncertainty in a certificate: "build", once
the vehicle is built, weighed and calibrated; "day", on the day, from a forecast, a survey or a look at the place;
"never".
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, Protocol
from zlib import crc32

import numpy as np
from pydantic import ConfigDict, Field, field_validator, model_validator

from flownav.core.measurement import Array
from flownav.core.parameter_files import Number, ParameterModel, load, shipped
from flownav.simulation.inverses import inverse_of
from flownav.simulation.noise import threefry

Known = Literal["build", "day", "never"]

SHIPPED, SHIPPED_FILE = "shipped", "dispersion.toml"
LARGEST_SHAPE = 1e300  # of a parameter of a distribution
DISPERSION_STEP = 1 << 41  # of the noise counter: beyond every step of a flight and of its start


class Distribution(ParameterModel):
    """A continuous distribution of scipy.stats; what is not named here are its shape parameters.

    known: a number without `known` is never known.
    """

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)

    distribution: str  # its name in scipy.stats, as norm, uniform, truncnorm
    loc: Number = 0.0  # SciPy's: of norm the mean, of uniform the lower end
    scale: Number = Field(1.0, gt=0.0)  # SciPy's: of norm the standard deviation, of uniform the width
    mode: Literal["value", "factor", "offset", "uncertainty"] = "value"  # the draw itself, or how it alters the file's
    source: str = ""  # where the figures come from
    known: Known = "never"  # who can know it before: build, once built; day, on the day; never

    @model_validator(mode="after")
    def _shapes_are_numbers(self) -> Distribution:
        for name, value in self.shapes.items():
            if isinstance(value, bool) or not isinstance(value, (int, float)):
                raise ValueError(f"{name} = {value!r}: a shape parameter is a number")
            if not -LARGEST_SHAPE < value < LARGEST_SHAPE:
                raise ValueError(f"{name}: a shape parameter is a finite number")
        return self

    @property
    def shapes(self) -> dict[str, float]:
        """The shape parameters by SciPy's names."""
        return dict(self.model_extra or {})

    def frozen(self) -> Any:
        """The distribution with these parameters, SciPy's or one that stands for it (`ppf`, `support`).

        ValueError where there is none such.
        """
        if known := inverse_of(self.distribution, self.shapes, self.loc, self.scale):
            return known
        return _frozen(self.distribution, self.loc, self.scale, tuple(sorted(self.shapes.items())))


@lru_cache(maxsize=1024)
def _frozen(name: str, loc: float, scale: float, shapes: tuple[tuple[str, float], ...]) -> Any:
    """SciPy takes 2 ms to make one, and a ranking asks for the same fifty again and again."""
    from scipy import stats  # not without need: it takes 46 MB

    family = getattr(stats, name, None)
    if not isinstance(family, stats.rv_continuous):
        raise ValueError(f'distribution = "{name}": no continuous distribution of scipy.stats')
    wanted = [shape.strip() for shape in (family.shapes or "").split(",") if shape.strip()]
    if sorted(wanted) != [shape for shape, _ in shapes]:
        raise ValueError(f'distribution = "{name}" has the shape parameters {", ".join(wanted) or "none"}')
    found = family(**dict(shapes), loc=loc, scale=scale)
    if not np.isfinite(found.ppf(0.5)):
        raise ValueError(f'distribution = "{name}" cannot be with {dict(shapes) or "this scale"}')
    return found


class DispersionSection(ParameterModel):
    """A scenario's `[dispersion]`. file: the entries that hold where the scenario names none of its own.

    "shipped" is the file that ships with flownav. Entries may be nested tables, as TOML's dotted keys are. fixed:
    numbers that all flights have as the scenario states them, whatever the file draws, "wind.from_direction_deg".
    """

    file: str = SHIPPED
    fixed: tuple[str, ...] = ()  # numbers by dotted name that are not drawn
    parameters: dict[str, Distribution] = Field(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _flattened(cls, given: Any) -> Any:
        if not isinstance(given, Mapping) or isinstance(given.get("parameters"), Mapping):
            return given
        own = {name: given[name] for name in ("file", "fixed") if name in given}
        entries = {name: table for name, table in given.items() if name not in own}
        return own | {"parameters": dict(leaves(entries, ""))}

    def entries(self) -> dict[str, Distribution]:
        """The file's, and the scenario's own above them, less what is fixed. InputError where the file is wrong."""
        path = shipped(SHIPPED_FILE) if self.file == SHIPPED else Path(self.file)
        found = {**load(path, DispersionFile).dispersion.parameters, **self.parameters}
        return {name: entry for name, entry in found.items() if name not in self.fixed}


class DispersionFile(ParameterModel):
    """A file of such entries, for many scenarios."""

    schema_version: Literal[1]  # of this kind of file; 1
    name: str  # of these entries
    provenance: str  # where the figures come from
    dispersion: DispersionSection

    @field_validator("dispersion")
    @classmethod
    def _is_whole(cls, section: DispersionSection) -> DispersionSection:
        if {"file", "fixed"} & section.model_fields_set:
            raise ValueError("file, fixed: a dispersion file names no other one, and leaves out what it does not draw")
        return section


def leaves(table: Mapping[str, Any], above: str) -> Iterator[tuple[str, Any]]:
    """Every entry of nested tables by its dotted name; a distribution is an entry."""
    for key, value in table.items():
        if isinstance(value, Mapping) and "distribution" not in value:
            yield from leaves(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def raises_wind(entries: Mapping[str, Distribution]) -> bool:
    """Whether a flight may have wind where the scenario has none."""
    entry = entries.get("wind.speed_20ft_m_s")
    return entry is not None and entry.mode != "factor"


class Design(Protocol):
    """A design that spreads the inputs over an ensemble's flights."""

    def uniforms(self, seed: int, flights: Sequence[int], name: str) -> Array:
        """One number in (0, 1) of each flight for the input `name`, of (seed, flight, name) and nothing else."""


def uniforms(seed: int, flights: Sequence[int], name: str) -> Array:
    """One number in (0, 1) of each flight, by the noise counter: of (seed, flight, name) and nothing else."""
    index = np.asarray(flights, np.uint64)
    step = np.full_like(index, DISPERSION_STEP + crc32(name.encode()))
    word, _ = threefry(index, step * np.uint64(256), np.full_like(index, seed), np.zeros_like(index))
    return np.asarray(((word >> np.uint64(11)).astype(float) + 0.5) * 2.0**-53)


def drawn(mode: str, draw: float, believed: float, below: float, above: float) -> float:
    """The true value; below and above: how far the uncertainty reaches on either side of what is believed."""
    if mode == "value":
        return draw
    if mode == "factor":
        return draw * believed
    return believed + (draw if mode == "offset" else draw * (above if draw > 0.0 else below))
