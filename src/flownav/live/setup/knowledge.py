"""The parameters that flownav needs of each make: data/setup/*.toml, checked, with the sentence that explains each."""

from typing import Literal

from flownav.core.parameter_files import ParameterModel, load, shipped
from flownav.logs.mavlink.framing import ARDUPILOT, PX4, Value

MAKES = {ARDUPILOT: "setup/ardupilot.toml", PX4: "setup/px4.toml"}
SETS = (1, 2, 3)  # ArduPilot's source sets
Level = Literal["must", "advised", "shown"]
Send = Literal["odometry", "vision", "landing-target", "none"]


class Rule(ParameterModel):
    """Which values fit. All that is stated must hold; bits are those of a bit mask."""

    one_of: tuple[float, ...] = ()
    exclude: tuple[float, ...] = ()
    at_least: float | None = None
    at_most: float | None = None
    bits_set: int = 0
    bits_clear: int = 0

    def fits(self, number: float) -> bool:
        """Whether a value fits, to a float's precision."""
        near = 1e-6 * max(1.0, abs(number))
        return (
            (not self.one_of or any(abs(number - wanted) <= near for wanted in self.one_of))
            and not any(abs(number - refused) <= near for refused in self.exclude)
            and (self.at_least is None or number >= self.at_least - near)
            and (self.at_most is None or number <= self.at_most + near)
            and (int(number) & (self.bits_set | self.bits_clear)) == self.bits_set
        )

    def words(self) -> str:
        """The wanted value in a few words; "" where any value fits."""
        terms = [" or ".join(f"{wanted:g}" for wanted in self.one_of)] if self.one_of else []
        terms += [f"not {' nor '.join(f'{refused:g}' for refused in self.exclude)}"] if self.exclude else []
        if self.at_least is not None and self.at_most is not None:
            terms.append(f"{self.at_least:g} to {self.at_most:g}")
        else:
            terms += [f"at least {self.at_least:g}"] if self.at_least is not None else []
            terms += [f"at most {self.at_most:g}"] if self.at_most is not None else []
        for mask, state in ((self.bits_set, "set"), (self.bits_clear, "clear")):
            bits = [str(bit) for bit in range(mask.bit_length()) if mask >> bit & 1]
            terms += [f"bit{'s' if len(bits) > 1 else ''} {' and '.join(bits)} {state}"] if bits else []
        return ", ".join(terms)


class Wanted(Rule):
    """A parameter that matters. name and any_of: {n} stands for the source set.

    any_of: one of these must fit. alternatives: names in other versions. sends: for which `--send` (none given: all).
    optional: its absence is no fault. set_to: what `--write` sets where the value does not fit; bit masks keep the
    bits that are not named. meaning: in the make's words. source: file of the make's code or page of its documentation.
    """

    name: str
    alternatives: tuple[str, ...] = ()
    any_of: tuple[str, ...] = ()
    sends: tuple[Send, ...] = ()
    level: Level
    optional: bool = False
    set_to: float | None = None
    meaning: str = ""
    unit: str = ""
    reboot: bool = False
    why: str
    source: str

    def repaired(self, number: float) -> float | None:
        """The value that `--write` would set in place of one that does not fit; None where the user must choose."""
        if self.bits_set or self.bits_clear:
            return float((int(number) | self.bits_set) & ~self.bits_clear)
        return self.set_to


class Arming(Rule):
    """Values at which the make refuses to arm. {any} stands for every source set, {name} for the parameter.

    needs: where a value is one of these, this parameter must not be one of needs_not; or_any: others, any of which will
    do in its place. says: the make's own words.
    """

    names: tuple[str, ...]
    needs: str = ""
    needs_not: tuple[float, ...] = ()
    or_any: tuple[str, ...] = ()
    says: str
    source: str

    def blocks(self, name: str, values: dict[str, Value]) -> bool:
        """Whether this rule keeps a vehicle with these values from arming, by one parameter."""
        found = values.get(name)
        if found is None or not self.fits(found.number):
            return False
        others = [values[other].number for other in (self.needs, *self.or_any) if other in values]
        return not self.needs or (self.needs in values and all(number in self.needs_not for number in others))


class Knowledge(ParameterModel):
    """A make's knowledge. notes and in_flight: sentences; first_source_set: our own if none is in use, 0: none."""

    schema_version: Literal[1]
    make: int
    name: str
    first_source_set: int
    serial_parameters: Literal["SERIAL", "MAV"]
    notes: tuple[str, ...]
    in_flight: tuple[str, ...]
    parameter: tuple[Wanted, ...]
    arming: tuple[Arming, ...] = ()

    def wanted(self, send: str, source_set: int) -> list[Wanted]:
        """The rows for a `--send`, with the source set in their names."""
        return [
            row.model_copy(update={"name": row.name.replace("{n}", str(source_set))})
            for row in self.parameter
            if not row.sends or send in row.sends
        ]

    def arming_names(self, rule: Arming) -> list[str]:
        """The parameters that an arming rule looks at."""
        return [name.replace("{any}", str(n)) for name in rule.names for n in (SETS if "{any}" in name else (0,))]

    def names(self, send: str) -> list[str]:
        """Every parameter to ask for, once."""
        asked = [
            name
            for rule in self.arming
            for name in [*self.arming_names(rule), *([rule.needs] if rule.needs else []), *rule.or_any]
        ]
        for row in self.wanted(send, self.first_source_set):
            asked += row.any_of or (row.name, *row.alternatives)
        return list(dict.fromkeys(asked))


def knowledge_of(make: int) -> Knowledge | None:
    """The known rules of a make (MAV_AUTOPILOT); None where there are none."""
    return load(shipped(MAKES[make]), Knowledge) if make in MAKES else None
