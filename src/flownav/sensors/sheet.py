"""Entries of every sensor's datasheet: a name, where its figures come from, its clock, and spells of chance.

A datasheet is a TOML file with units in its key names. `rate_hz` is how often the sensor reads, `latency_s` how old a
reading is when it arrives, and `jitter_s` how unevenly it arrives: the age lies evenly within latency_s +- jitter_s.
"""

from pathlib import Path
from typing import ClassVar, Literal, Self

from pydantic import Field, ValidationInfo, field_validator

from flownav.core.parameter_files import Number, ParameterModel, load, shipped
from flownav.sensors.processes import spell_levels


class SensorSheet(ParameterModel):
    """The head of a datasheet; `shipped_file` is the one that serves where no path is given, or there is none."""

    shipped_file: ClassVar[str] = ""

    schema_version: Literal[1]  # of this kind of file; 1
    name: str  # of the sensor
    provenance: str  # where the figures come from
    rate_hz: Number = Field(gt=0.0, le=1000.0)  # readings a second
    latency_s: Number = Field(ge=0.0, le=2.0)  # age of a reading when it arrives, on average
    jitter_s: Number = Field(0.0, ge=0.0, le=1.0, validate_default=True)  # ages lie evenly within latency_s +- this

    @field_validator("jitter_s")
    @classmethod
    def _not_before_it_was_read(cls, value: float, info: ValidationInfo) -> float:
        if value > info.data.get("latency_s", value):
            raise ValueError(f"at most latency_s = {info.data['latency_s']:g} is needed (no reading arrives too early)")
        return value

    @property
    def period_s(self) -> float:
        """Time between readings."""
        return 1.0 / self.rate_hz

    @classmethod
    def read(cls, path: Path | str | None = None) -> Self:
        """The sheet of a file; the shipped one where `path` is None. InputError names file, key and allowed range."""
        return load(Path(path) if path is not None else shipped(f"sensors/{cls.shipped_file}"), cls)


class Spells(ParameterModel):
    """Spells that come by chance: what share of the time they fill, and how long one lasts on average."""

    share: Number = Field(0.0, ge=0.0, le=0.5)  # of the time that they fill; 0: they never come
    mean_s: Number = Field(1.0, gt=0.0, le=1e4)  # how long one lasts on average

    def levels(self, period_s: float) -> tuple[float, float]:
        """`(begins_above, ends_above)` for a standard normal drawn once a period."""
        return spell_levels(self.share, self.mean_s, period_s)


class Lever(ParameterModel):
    """Where the sensor sits, from the centre of gravity, body FRD."""

    forward_m: Number = Field(0.0, ge=-10.0, le=10.0)  # of the centre of gravity; negative: behind it
    right_m: Number = Field(0.0, ge=-10.0, le=10.0)  # of the centre of gravity; negative: to its left
    down_m: Number = Field(0.0, ge=-10.0, le=10.0)  # below the centre of gravity; negative: above it
