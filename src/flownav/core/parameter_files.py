"""TOML parameter files: units in the key names, provenance beside the values, one clear line on a mistake.

A number may stand bare, `radius_m = 0.89`, or with its provenance,
`radius_m = { value = 0.89, uncertainty = 0.03, source = "800 mm blade + grip" }`.
A file's schema is a pydantic model of `Number` fields with their allowed ranges.
"""

import math
import tomllib
from collections.abc import Callable, Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError, ValidationInfo
from pydantic_core import core_schema

from flownav.core.errors import InputError
from flownav.core.text import meant

PROVENANCE_KEYS = {"value", "uncertainty", "source"}
MOST_BYTES = 4_000_000  # of a file: the largest that ships has 30 000
DEEPEST_NESTING = 20  # tables and lists in each other
LONGEST_SHOWN = 300  # characters of a key, a value or a sentence in a message


def _value_of(entry: Any) -> Any:
    """The number of an entry that may carry its provenance."""
    if isinstance(entry, dict):
        if "value" not in entry or not set(entry) <= PROVENANCE_KEYS:
            raise ValueError("an entry with provenance is { value = ..., uncertainty = ..., source = ... }")
        return _number(entry["value"])
    return _number(entry)


def _number(entry: Any) -> Any:
    """Refuse what pydantic would turn into a number."""
    if isinstance(entry, bool | str):
        raise ValueError("a number is needed, not true, false or text")
    return entry


class _Given:
    """A number with or without its provenance: a BeforeValidator that pydantic need not look into at every field."""

    @staticmethod
    def __get_pydantic_core_schema__(source: Any, handler: Callable[[Any], Any]) -> Any:
        return core_schema.no_info_before_validator_function(_value_of, handler(source))


Number = Annotated[float, _Given()]


class ParameterModel(BaseModel):
    """Base of every file schema: unknown keys, NaN and infinity are refused; loaded values are frozen."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)


def more_than(key: str) -> Callable[[float, ValidationInfo], float]:
    """A field's validator: its value must be more than that of a key above it."""

    def checked(value: float, info: ValidationInfo) -> float:
        if value <= info.data.get(key, 0.0):
            raise ValueError(f"more than {key} = {info.data[key]:g} is needed")
        return value

    return checked


Model = TypeVar("Model", bound=BaseModel)
Record = TypeVar("Record", bound=tuple[Any, ...])

# a file's units beside those of the equations, as words of a key
IN_SI: dict[str, tuple[str, Callable[[float], float]]] = {
    "deg": ("rad", math.radians),
    "percent": ("", lambda percent: 0.01 * percent),
    "mrad": ("rad", lambda mrad: 1e-3 * mrad),
    "mgauss": ("gauss", lambda mgauss: 1e-3 * mgauss),
}


def in_si(model: BaseModel, before: str = "") -> dict[str, float]:
    """Every number of a checked file by its key in SI units, behind the names of the tables that it stands in.

    `bias_deg_s` of the table `gyro` is `gyro_bias_rad_s`; a share in per cent is a share.
    """
    found: dict[str, float] = {}
    for key, value in model:
        if isinstance(value, BaseModel):
            found |= in_si(value, f"{before}{key}_")
        elif isinstance(value, float):
            words = f"{before}{key}".split("_")
            for word in words:
                value = IN_SI[word][1](value) if word in IN_SI else value
            found["_".join(name for word in words if (name := IN_SI.get(word, (word,))[0]))] = value
    return found


def record_of(record: type[Record], numbers: Mapping[str, float], **derived: Any) -> Record:
    """A record of an equation's parameters: its fields are those of a file's numbers, but for what is derived."""
    fields: tuple[str, ...] = vars(record)["_fields"]
    return record(**{name: numbers[name] for name in fields if name not in derived}, **derived)


def shipped(name: str) -> Path:
    """The path of a data file that ships with flownav, e.g. `maxi_joker_3.toml`."""
    return Path(str(resources.files("flownav") / "data" / name))


def read_toml(path: Path) -> dict[str, Any]:
    """A TOML file as nested dictionaries. InputError names the file and the line at fault."""
    from flownav.core.guard import an_input

    try:
        with an_input(path).open("rb") as file:
            content = file.read(MOST_BYTES + 1)
        if len(content) > MOST_BYTES:
            raise InputError(f"{path}: more than {MOST_BYTES:,} bytes; a parameter file is needed")
        entries = tomllib.loads(content.decode("utf-8").replace("\r\n", "\n").replace("\r", "\n"))
        if _deeper_than(entries, DEEPEST_NESTING):
            raise RecursionError
        return entries
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not valid TOML: {_one_line(str(error))}") from None
    except ValueError:  # Python's own limit on an integer's digits
        raise InputError(f"{path}: not valid TOML: an integer of thousands of digits") from None
    except RecursionError:
        raise InputError(f"{path}: not valid TOML: tables or lists nested too deep") from None


def _deeper_than(entries: Any, levels: int) -> bool:
    """Whether tables and lists stand in each other more than `levels` deep."""
    floor = [entries]
    for _ in range(levels):
        floor = [inner for outer in floor for inner in (outer.values() if isinstance(outer, dict) else outer)]
        floor = [inner for inner in floor if isinstance(inner, dict | list)]
    return bool(floor)


def load(path: Path, schema: type[Model]) -> Model:
    """Read and check a parameter file. InputError names file, key and what is allowed, in one line."""
    return check(read_toml(path), schema, str(path))


def check(entries: dict[str, Any], schema: type[Model], where: str) -> Model:
    """Check entries against a schema. InputError as `load`; `where` names the file."""
    try:
        return schema.model_validate(entries)
    except ValidationError as error:
        # a misspelt key is reported before the key that it should have been
        first, *others = sorted(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
        key = _one_line(".".join(str(part) for part in first["loc"]))
        more = f" (and {len(others)} more)" if others else ""
        raise InputError(f"{where}: {key}: {_sentence(first, schema)}{more}") from None


def _sentence(error: Any, schema: type[BaseModel]) -> str:
    """One sentence on the error of a key, and what would be right."""
    kind, given = error["type"], error["input"]
    if kind == "extra_forbidden":
        known = sorted(_keys_beside(error["loc"], schema))
        return f"unknown key; known here: {', '.join(known)}{meant(str(error['loc'][-1]), known)}"
    if kind == "missing":
        return "missing; add it"
    return f"{_one_line(error['msg'].removeprefix('Value error, '))}, got {as_shown(_number_of(given))}"


def as_shown(given: Any) -> str:
    """A value as a message shows it: on one line, not endless."""
    try:
        return _one_line(repr(given))
    except (ValueError, RecursionError):  # an integer too long to be written, a nest too deep
        return f"something that is too long to show ({type(given).__name__})"


def _one_line(text: str) -> str:
    text = "".join(character if character.isprintable() else repr(character)[1:-1] for character in text)
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."


def _number_of(given: Any) -> Any:
    return given.get("value", given) if isinstance(given, dict) else given


def _keys_beside(location: tuple[Any, ...], schema: type[BaseModel]) -> list[str]:
    """The field names of the table in which an unknown key stands; tables in lists count."""
    model: Any = schema
    for part in location[:-1]:
        if isinstance(part, int):
            continue
        info = model.model_fields.get(part)
        models = [m for m in _types_in(info.annotation) if issubclass(m, BaseModel)] if info is not None else []
        if not models:
            return []
        model = models[0]
    return list(model.model_fields)


def _types_in(annotation: Any) -> list[type]:
    """Every class that an annotation such as tuple[Knot, ...] names."""
    inner = [found for argument in get_args(annotation) for found in _types_in(argument)]
    return inner or ([annotation] if isinstance(annotation, type) else [])
