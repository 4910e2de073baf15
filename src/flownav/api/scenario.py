"""Scenario: what is flown, as a Python object that is loaded, changed, flown and saved."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flownav.api.arguments import checked
from flownav.api.calls import merged, plain_entries, saved
from flownav.api.sensor import Sensor
from flownav.api.vehicle import Vehicle
from flownav.core.errors import InputError, arg
from flownav.core.parameter_files import check
from flownav.simulation.dispersion import SHIPPED as SHIPPED_DISPERSION
from flownav.simulation.scenario import Scenario as File
from flownav.simulation.scenario import load_scenario
from flownav.vehicle.kinds import SHIPPED_NAMES

WORDS = {"gps": "model", "filter": "name", "vehicle": "file", "autopilot": "feedback"}  # what one word for a table says


class Scenario:
    """The flight to be flown: path, vehicle, sensors, wind, filter and autopilot, as docs/reference/scenarios.md has
    them.

    file: the checked scenario file; its tables are attributes of it. A Scenario never changes; `changed` makes another.

    Example:
        >>> import flownav
        >>> scenario = flownav.Scenario.load("landing")
        >>> windy = scenario.changed(wind={"speed_20ft_m_s": 6.0}, gps="midg")
        >>> windy.file.gps.model
        'midg'
    """

    @checked
    def __init__(self, file: File) -> None:
        self.file = file

    @classmethod
    @checked
    def load(cls, name_or_path: str | Path) -> Scenario:
        """A shipped scenario by its name (`flownav.simulation.scenario.SHIPPED`), or a TOML file.

        InputError, one line, where there is none of that name, or the file names what a scenario does not have.

        Example:
            >>> flownav.Scenario.load("takeoff").name
            'takeoff'
        """
        return cls(load_scenario(str(name_or_path)))

    @property
    def name(self) -> str:
        """The scenario's name, after which records are called.

        Example:
            >>> flownav.Scenario.load("approach").name
            'approach'
        """
        return self.file.name

    @property
    def description(self) -> str:
        """The file's own description, one line.

        Example:
            >>> "land" in flownav.Scenario.load("landing").description
            True
        """
        return self.file.description

    def to_dict(self) -> dict[str, Any]:
        """The whole scenario as nested dictionaries, defaults and all.

        Example:
            >>> flownav.Scenario.load("landing").to_dict()["flight"]["duration_s"]
            50.0
        """
        found: dict[str, Any] = self.file.model_dump(mode="json")
        return found

    def changed(self, **changes: Any) -> Scenario:
        """Another scenario with other values: nested mappings are merged into the scenario's own tables.

        changes: the keys of a scenario file. One word stands for a table where it is plain what it means: `gps="midg"`,
        `filter="paper"`, `autopilot="truth"`, `vehicle="quad-450"`, `wind=8` or `wind="8:270"` (m/s at 20 ft, from the
        west). `vehicle` takes a Vehicle too, and `flow_sensor` a
        Sensor or a path. What is None is left as it is. A dotted name reaches inside: `{"flight.duration_s": 20.0}`.
        A direction of the wind that is given is that of every flight, of an ensemble too.
        InputError, one line, for an unknown key and for a value out of its range.

        Example:
            >>> scenario = flownav.Scenario.load("landing")
            >>> scenario.changed(flight={"duration_s": 20.0}, filter="paper").file.filter.name
            'paper'
            >>> scenario.changed(**{"wind.speed_20ft_m_s": 4.0}).file.wind.speed_20ft_m_s
            4.0
        """
        given = {name: _given(name, value) for name, value in changes.items() if value is not None}
        if not given:
            return self
        entries = self.file.model_dump(exclude_unset=True)
        model = given.get("gps", {}).get("model") if isinstance(given.get("gps"), Mapping) else None
        if model is not None and model != self.file.gps.model:
            entries.pop("gps", None)  # another model has other numbers
        changed = check(merged(entries, given, self.name), File, f"{self.name}, as changed")
        return Scenario(_with_its_wind(changed) if _names_direction(given) else changed)

    @checked
    def save(self, path: str | Path) -> Path:
        """Write a scenario file that `load` and `flownav fly` read; where it lies.

        Files that the scenario names are written with their whole path. InputError where nothing can be written there.

        Example:
            >>> scenario = flownav.Scenario.load("landing").changed(gps="midg")
            >>> flownav.Scenario.load(scenario.save(folder / "midg.toml")) == scenario
            True
        """
        entries = plain_entries(_with_whole_paths(self.file.model_dump(exclude_unset=True)))
        return saved(entries, Path(path))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scenario) and self.file == other.file

    def __hash__(self) -> int:
        return hash(self.name)

    def __repr__(self) -> str:
        file, vehicle = self.file, self.file.vehicle.file or "maxi-joker-3"
        what = f"{file.flight.duration_s:g} s, {vehicle}, {file.gps.model} GPS, {file.filter.name} filter"
        return f"<Scenario {self.name}: {what}>"


def scenario_of(given: Scenario | str | Path, **changes: Any) -> Scenario:
    """A scenario by whatever stands for one, with these changes. InputError as `Scenario.load` and `changed`."""
    own = given if isinstance(given, Scenario) else Scenario.load(given)
    return own.changed(**changes)


def _given(name: str, value: Any) -> Any:
    """A change as the file has it."""
    if name == "vehicle" and isinstance(value, Vehicle):
        return {"file": str(value.file_path())}
    if name == "flow_sensor" and isinstance(value, Sensor):
        return str(value.file_path())
    if name == "wind" and isinstance(value, (int, float, str)) and not isinstance(value, bool):
        return wind_of(str(value))
    if isinstance(value, Path):
        value = str(value)
    return {WORDS[name]: value} if name in WORDS and isinstance(value, str) else value


DIRECTION = "wind.from_direction_deg"


def wind_of(text: str) -> dict[str, float]:
    """The wind that "8" or "8:270" stands for: speed at 20 ft [m/s], and where it blows from [deg]. InputError
    otherwise.
    """
    speed, _, direction = text.partition(":")
    try:
        given = {"speed_20ft_m_s": float(speed)}
        return given | ({"from_direction_deg": float(direction)} if direction else {})
    except ValueError:
        raise InputError(f"{arg('wind')} {text}: m/s at 20 ft, and degrees where it blows from: 8, or 8:270") from None


def _names_direction(given: Mapping[str, Any]) -> bool:
    """Whether changes state where the wind blows from."""
    wind = given.get("wind")
    return DIRECTION in given or (isinstance(wind, Mapping) and DIRECTION.partition(".")[2] in wind)


def _with_its_wind(file: File) -> File:
    """The scenario with the wind from its own direction in all flights, whatever its dispersion draws."""
    fixed = tuple(dict.fromkeys((*file.dispersion.fixed, DIRECTION)))
    return file.model_copy(update={"dispersion": file.dispersion.model_copy(update={"fixed": fixed})})


def _with_whole_paths(entries: dict[str, Any]) -> dict[str, Any]:
    """Entries whose files are found from anywhere."""
    found = dict(entries)
    if found.get("flow_sensor"):
        found["flow_sensor"] = _whole(found["flow_sensor"])
    if found.get("vehicle"):
        found["vehicle"] = {**found["vehicle"], "file": _whole(found["vehicle"].get("file"))}
    if found.get("sensors"):
        found["sensors"] = {k: v if k == "texture" else _whole(v) for k, v in found["sensors"].items()}
    if found.get("dispersion", {}).get("file", SHIPPED_DISPERSION) != SHIPPED_DISPERSION:
        found["dispersion"] = {**found["dispersion"], "file": _whole(found["dispersion"]["file"])}
    return found


def _whole(file: str | None) -> str | None:
    return file if file is None or file in SHIPPED_NAMES else str(Path(file).absolute())
