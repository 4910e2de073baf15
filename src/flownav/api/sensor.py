"""Sensor: an optical-flow sensor's datasheet as a Python object, shipped, read from a file or just identified."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from flownav.api.arguments import checked
from flownav.api.calls import kept_file, merged
from flownav.core.errors import InputError
from flownav.core.parameter_files import check, read_toml, shipped
from flownav.sensors.datasheet import DEFAULT_SENSOR, FlowSensor

if TYPE_CHECKING:
    from flownav.lab.identification.findings import Findings

PAPER, NAN = "px4flow-paper", float("nan")


class Valued(NamedTuple):
    """A figure with its 95 % interval; low and high are NaN where the file gives none."""

    value: float
    low: float
    high: float


class Sensor:
    """A flow sensor: gain, latency, dynamics, noise against height, limits, optics (docs/explanation/sensors.md).

    entries: its file as nested dictionaries; file: the same, checked. findings: what an identification found besides,
    None of a sensor that was loaded. A Sensor never changes; `changed` makes another.

    Example:
        >>> import flownav
        >>> sensor = flownav.Sensor.load("px4flow-paper")
        >>> round(sensor.gain.value, 2)
        1.03
    """

    @checked
    def __init__(self, entries: dict[str, Any], path: Path | None = None, findings: Findings | None = None) -> None:
        self.entries, self.path, self.findings = entries, path, findings
        self.file: FlowSensor = check(entries, FlowSensor, str(path or entries.get("name", "the sensor")))

    @classmethod
    @checked
    def load(cls, name_or_path: str | Path = PAPER) -> Sensor:
        """The paper's sensor by its name, px4flow-paper, or a TOML file such as `flownav identify` writes.

        InputError, one line, where the file is missing or names what a sensor does not have.

        Example:
            >>> flownav.Sensor.load().name
            "PX4FLOW, the paper's selected model"
        """
        path = shipped(DEFAULT_SENSOR) if str(name_or_path) == PAPER else Path(name_or_path)
        return cls(read_toml(path), path)

    @property
    def name(self) -> str:
        """The name in the file.

        Example:
            >>> "PX4FLOW" in flownav.Sensor.load().name
            True
        """
        return self.file.name

    @property
    def gain(self) -> Valued:
        """Reported over true velocity of slow motion, with its 95 % interval where it was identified.

        Example:
            >>> 0.9 < flownav.Sensor.load().gain.value < 1.1
            True
        """
        found = self.file.identification
        own = (self.file.dynamics.gain, NAN, NAN) if found is None else (found.gain, found.gain_low, found.gain_high)
        return Valued(*map(float, own))

    @property
    def latency_s(self) -> Valued:
        """Delay of slow motion [s], with its 95 % interval where it was identified.

        Where `verdict` does not report the latency, the log's motion does not show it: do not build on the value.

        Example:
            >>> 0.0 < flownav.Sensor.load().latency_s.value < 0.5
            True
        """
        found, delay_s = self.file.identification, self.file.dynamics.delay_s
        own = (delay_s, NAN, NAN) if found is None else (found.latency_s, found.latency_low_s, found.latency_high_s)
        return Valued(*map(float, own))

    @property
    def facts(self) -> dict[str, Any]:
        """Everything that an identification found, as `flownav identify --json` prints it; empty where none was made.

        Example:
            >>> flownav.Sensor.load().facts
            {}
        """
        from flownav.lab.identification.findings import facts_of

        return {} if self.findings is None else facts_of(self.findings)

    @property
    def verdict(self) -> str:
        """Verdict on the log that it was identified from; "" where no identification stands in the file.

        Example:
            >>> flownav.Sensor.load().verdict
            ''
        """
        return "" if self.file.identification is None else self.file.identification.verdict

    @checked
    def sigma_m_s(self, height_m: float) -> float:
        """Standard deviation of a velocity reading at a height [m/s].

        Example:
            >>> sensor = flownav.Sensor.load()
            >>> sensor.sigma_m_s(1.5) > sensor.sigma_m_s(0.6)
            True
        """
        from numpy.polynomial.polynomial import polyval

        law = self.file.noise.fit()
        root = (min(max(height_m, law.low_m), law.high_m) ** 0.25 - law.centre) * law.scale
        return max(float(polyval(root, law.coefficients)), float(self.file.noise.floor_m_s))

    def changed(self, **changes: Any) -> Sensor:
        """Another sensor with other numbers; nested mappings are merged into the sensor's own tables.

        InputError, one line, for an unknown key and for a value out of its range.

        Example:
            >>> flownav.Sensor.load().changed(limits={"max_height_m": 8.0}).file.limits.max_height_m
            8.0
        """
        return Sensor(merged(self.entries, changes, self.name), None, self.findings) if changes else self

    @checked
    def save(self, path: str | Path) -> Path:
        """Write the sensor file that fly, replay, campaign and live read; where it lies. InputError where it cannot be.

        Example:
            >>> sensor = flownav.Sensor.load()
            >>> flownav.Sensor.load(sensor.save(folder / "sensor.toml")).gain.value == sensor.gain.value
            True
        """
        path = Path(path)
        if path.suffix != ".toml":
            raise InputError(f"{path}: a sensor file's name ends in .toml")
        from flownav.lab.identification.sensor_file import write_sensor

        write_sensor(path, self.entries)
        return path

    @checked
    def save_parameters(self, path: str | Path, autopilot: str = "px4") -> dict[str, float]:
        """Write the autopilot's parameters that follow from an identification; each by its name.

        autopilot: "px4", "ardupilot" or "inav". InputError for another, and for a sensor that was not just identified.

        Example:
            >>> flownav.Sensor.load().save_parameters(folder / "sensor.params")
            Traceback (most recent call last):
            flownav.core.errors.InputError: PX4FLOW, the paper's selected model: parameters follow from what \
flownav.identify found; identify it anew
        """
        from flownav.lab.identification.autopilot_parameters import write_parameters

        if self.findings is None:
            raise InputError(f"{self.name}: parameters follow from what flownav.identify found; identify it anew")
        found = write_parameters(Path(path), autopilot, self.findings, self.name)
        return {parameter.name: float(parameter.text) for parameter in found}

    def file_path(self) -> Path:
        """A file with this sensor, for a scenario to name: its own, or one that lasts as long as this process.

        Example:
            >>> flownav.Sensor.load().file_path().name
            'px4flow_paper.toml'
        """
        return self.path or kept_file(self.name, self.entries)

    def __repr__(self) -> str:
        gain, found = _shown(self.gain, 1.0, 3, ""), self.file.identification
        unseen = found is not None and found.identifiable < 2  # the gain alone
        latency = "not shown by its log" if unseen else _shown(self.latency_s, 1e3, 0, " ms")
        return f"<Sensor {self.name}: gain {gain}, latency {latency}>"


def _shown(found: Valued, factor: float, digits: int, unit: str) -> str:
    value = f"{factor * found.value:.{digits}f}{unit}"
    if found.low != found.low:
        return value
    return f"{value} [{factor * found.low:.{digits}f}, {factor * found.high:.{digits}f}]"
