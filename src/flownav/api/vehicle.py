"""Vehicle: a helicopter or a multirotor as a Python object that is loaded, changed, flown and saved."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from flownav.api.arguments import checked
from flownav.api.calls import kept_file, merged, saved
from flownav.core.parameter_files import read_toml
from flownav.vehicle.kinds import AnyFile, flattened, read_kind, require_flyable, vehicle_file


class Vehicle:
    """A vehicle file: every number with its unit in its name, its uncertainty and where it comes from.

    entries: the file as nested dictionaries; file: the same, checked. A Vehicle never changes; `changed` makes another.

    Example:
        >>> import flownav
        >>> quad = flownav.Vehicle.load("quad-450")
        >>> heavy = quad.changed(body={"mass_kg": 1.5})
        >>> heavy.file.body.mass_kg
        1.5
    """

    @checked
    def __init__(self, entries: dict[str, Any], path: Path | None = None) -> None:
        where = str(path or entries.get("name", "the vehicle"))
        self.entries, self.path = entries, path
        self.file: AnyFile = read_kind(entries, where)
        require_flyable(flattened(self.file), where)

    @classmethod
    @checked
    def load(cls, name_or_path: str | Path = "maxi-joker-3") -> Vehicle:
        """A shipped vehicle (maxi-joker-3, quad-450, hexa-550), or a TOML file.

        InputError, one line, where the file is missing, has an unknown key, or such a vehicle cannot hover.

        Example:
            >>> flownav.Vehicle.load("hexa-550").kind
            'multirotor'
        """
        path = vehicle_file(Path(name_or_path))
        return cls(read_toml(path), path)

    @property
    def name(self) -> str:
        """The name in the file.

        Example:
            >>> flownav.Vehicle.load("quad-450").name
            '450 mm quadrotor, 10-inch propellers'
        """
        return str(self.file.name)

    @property
    def kind(self) -> str:
        """ "helicopter" or "multirotor".

        Example:
            >>> flownav.Vehicle.load().kind
            'helicopter'
        """
        return str(self.entries.get("kind", "helicopter"))

    def changed(self, **changes: Any) -> Vehicle:
        """Another vehicle with other numbers: tables merge, and a number keeps the uncertainty that the file gives it.

        InputError, one line, for an unknown key, a value out of its range, and a vehicle that cannot hover.

        Example:
            >>> flownav.Vehicle.load("quad-450").changed(name="mine", motor={"efficiency": 0.8}).name
            'mine'
        """
        return Vehicle(merged(self.entries, changes, self.name)) if changes else self

    @checked
    def save(self, path: str | Path) -> Path:
        """Write a vehicle file that `load` and `flownav fly --vehicle` read; where it lies.

        Example:
            >>> mine = flownav.Vehicle.load("quad-450").changed(body={"mass_kg": 1.5})
            >>> flownav.Vehicle.load(mine.save(folder / "mine.toml")).file == mine.file
            True
        """
        return saved(self.entries, Path(path))

    def file_path(self) -> Path:
        """A file with this vehicle, for a scenario to name: its own, or one that lasts as long as this process.

        Example:
            >>> flownav.Vehicle.load("quad-450").file_path().name
            'quad_450.toml'
        """
        return self.path or kept_file(self.name, self.entries)

    def __repr__(self) -> str:
        mass_kg = float(self.file.body.mass_kg)
        return f"<Vehicle {self.name}: {self.kind}, {mass_kg:g} kg>"
