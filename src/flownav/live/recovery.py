"""A journal becomes a Record: when its session ends, and when its session was killed."""

import mmap
from pathlib import Path
from typing import Annotated, Any, Generic, NamedTuple, TypeVar

import numpy as np

from flownav.core.compile import columns_of, width_of
from flownav.core.errors import InputError
from flownav.core.measurement import COLUMNS, MAX_VALUES, Array, Sensor
from flownav.core.record import FED, RATES, STATE, Record, Table
from flownav.logs.journal import MAGIC, Block, Damage, blocks
from flownav.navigation import tables
from flownav.navigation.rows import ESTIMATE_COLUMNS, EVENT_COLUMNS, INNOVATION_COLUMNS

T_S, SEGMENT = FED.index("t_s"), FED.index("segment")
NAN = float("nan")
Value = TypeVar("Value")


class TruthRow(NamedTuple, Generic[Value]):
    """A simulator's true state, as a journal keeps it; place: latitude, longitude [deg], altitude [m]."""

    t_s: Value
    place_deg_m: Annotated[Value, 3]
    vel_ned_m_s: Annotated[Value, 3]
    quaternion: Annotated[Value, 4]
    rate_frd_rad_s: Annotated[Value, 3]


class OriginRow(NamedTuple, Generic[Value]):
    """Where the local frame's origin lies, from an instant on."""

    since_s: Value
    place_deg_m: Annotated[Value, 3]


WIDTHS = {
    "fed": len(FED), "estimate": ESTIMATE_COLUMNS, "innovation": INNOVATION_COLUMNS, "event": EVENT_COLUMNS,
    "truth": width_of(TruthRow),
}  # fmt: skip


class Recovered(NamedTuple):
    """The content of a journal. ended: its session came to its end; torn_bytes: at its end, of a block that is not
    whole.

    blocks: whole ones; lost_bytes, lost_blocks: in its middle; unclaimed: rows fed to a navigator of which nothing is
    known, which are left out.
    """

    record: Record
    ended: bool
    blocks: int
    torn_bytes: int
    lost_bytes: int
    lost_blocks: int
    unclaimed: int


class _Story(NamedTuple):
    """The content of a journal: its blocks' entries, in order, and their rows."""

    head: dict[str, Any]
    segments: dict[int, dict[str, Any]]
    origins: Array  # rows of `OriginRow`
    notes: list[tables.Happening]
    facts: dict[str, Any]
    end: dict[str, Any] | None
    rows: dict[str, Array]


def recovered(journal: Path) -> Recovered:
    """The record of a journal, whole or cut off. InputError where it is none, or nothing can be made of it."""
    whole, damages = _read(journal)
    try:
        story = _story(whole, journal)
        fed = story.rows["fed"]
        known = np.isin(fed[:, SEGMENT], list(story.segments))
        unclaimed = int(np.count_nonzero(~known))
        if unclaimed:  # or a copy of all would be made
            fed = fed[known]
        story = story._replace(rows={**story.rows, "fed": _renumbered(fed, story.segments)})
        middle = [damage for damage in damages if not damage.tail]
        found = Recovered(
            Record(_manifest(story)),
            story.end is not None,
            len(whole),
            sum(damage.length for damage in damages if damage.tail),
            sum(damage.length for damage in middle),
            max(whole[-1].number + 1 - len(whole), len(middle)),
            unclaimed,
        )
        _fill(found.record, story, found)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError) as error:
        raise InputError(
            f"{journal}: its blocks are not those of a session ({error}); nothing can be made of it"
        ) from error
    return found


def _read(journal: Path) -> tuple[list[Block], list[Damage]]:
    """Its whole blocks, the rows still lying in the file, and the damage between and after them."""
    try:
        with journal.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise InputError(f"{journal}: not a journal; `flownav live --record` writes one beside its record")
            data = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
    except OSError as error:
        raise InputError(f"{journal}: cannot be read ({error.strerror}); see that it is there") from error
    found = list(blocks(data))
    whole = [part for part in found if isinstance(part, Block)]
    if not any("head" in part.stated for part in whole):
        raise InputError(f"{journal}: no whole block holds the settings of its navigator; nothing can be made of it")
    return whole, [part for part in found if isinstance(part, Damage)]


def _story(whole: list[Block], journal: Path) -> _Story:
    head = next(part.stated["head"] for part in whole if "head" in part.stated)
    if head["journal"] != 1 or head["columns"] != WIDTHS:
        version = dict(head["provenance"]).get("flownav")
        raise InputError(f"{journal}: of another flownav ({version}); recover it with that one")

    def listed(name: str) -> list[Any]:
        return [one for part in whole for one in part.stated.get(name, [])]

    facts = [part.stated["facts"] for part in whole if "facts" in part.stated]
    ends = [part.stated["end"] for part in whole if "end" in part.stated]
    return _Story(
        head,
        {int(number): dict(equipment) for number, equipment in listed("segments")},
        np.array(listed("origins"), float).reshape(-1, width_of(OriginRow)),
        [(float(t), str(who), str(what), str(more), float(value)) for t, who, what, more, value in listed("notes")],
        dict(ends[-1]["facts"] if ends else facts[-1] if facts else {}),
        dict(ends[-1]) if ends else None,
        {name: _rows(whole, name) for name in WIDTHS},
    )


def _rows(whole: list[Block], name: str) -> Array:
    return np.concatenate([np.zeros((0, WIDTHS[name])), *(part.rows[name] for part in whole if name in part.rows)])


def _renumbered(fed: Array, segments: dict[int, Any]) -> Array:
    """Segments count from zero without a gap in a record, whichever of the journal's are known."""
    if sorted(segments) != list(range(len(segments))):
        fed[:, SEGMENT] = np.searchsorted(sorted(segments), fed[:, SEGMENT])
    return fed


def _manifest(story: _Story) -> dict[str, Any]:
    fed, origins = story.rows["fed"], story.origins.tolist()
    return {
        "kind": "live",
        "filter": "landing",
        "duration_s": float(fed[-1, T_S] - fed[0, T_S]) if len(fed) else 0.0,
        "parameters": {
            **story.head["parameters"],
            **({"origin_lat_lon_deg_alt_m": origins[-1][1:]} if origins else {}),
        },
        **({"origins": origins} if len(origins) > 1 else {}),
        "segments": [story.segments[number] for number in sorted(story.segments)],
        "live": story.facts,
        "provenance": story.head["provenance"],
        "command": story.head["command"],
        "scores": {},
    }


def _fill(record: Record, story: _Story, found: Recovered) -> None:
    """Put the tables in."""
    fed, estimate, truth = (story.rows[name] for name in ("fed", "estimate", "truth"))
    record.add("estimate", tables.estimate_table(estimate))
    record.add("states", tables.states_table(estimate))
    record.add("fed", tables.fed_table(fed))
    for sensor in Sensor:
        rows = fed[fed[:, FED.index("sensor")] == sensor]
        if len(rows):
            record.add(sensor.name.lower(), _readings(sensor, rows))
    if len(truth) and len(story.origins):
        record.add("truth", _truth(truth, story.origins))
    record.add("innovation", tables.innovation_table(story.rows["innovation"]))
    record.add("events", _events(story, found))


def _events(story: _Story, found: Recovered) -> dict[str, Any]:
    events = tables.happenings(story.rows["event"]) + story.notes
    times_s = [*(event[0] for event in events), *story.rows["fed"][-1:, T_S].tolist()]
    last_s = max((t_s for t_s in times_s if t_s == t_s), default=0.0)
    lost = int((story.end or {}).get("notes_lost", 0))
    if lost:
        events.append((last_s, "live", "notes_lost", "happenings beyond these", float(lost)))
    if story.end is None:
        events.append((last_s, "live", "recording_ended", "the journal has no end: it was cut off", NAN))
    if found.lost_blocks:
        what = "blocks of the journal were damaged and are missing"
        events.append((last_s, "live", "journal_damaged", what, float(found.lost_blocks)))
    events.sort(key=lambda event: event[0])
    columns = list(zip(*events, strict=True)) or [()] * 5
    kinds = (float, str, str, str, float)
    names = ("t_s", "source", "kind", "detail", "value")
    return {name: np.array(column, kind) for name, column, kind in zip(names, columns, kinds, strict=True)}


def _readings(sensor: Sensor, rows: Array) -> Table:
    """A sensor's own table: by arrival, as other records have it."""
    first = FED.index("value_0")
    columns = dict(zip(COLUMNS[sensor], rows[:, first : first + MAX_VALUES].T, strict=False))
    return {"t_s": rows[:, FED.index("arrival_s")], **columns, "quality": rows[:, FED.index("quality")]}


def _truth(rows: Array, origins: Array) -> Table:
    """Position in the local frame of its time, velocity in body axes; the first of the origins holds before it too."""
    import pymap3d

    from flownav.core.frames import rotation_from_quaternion, to_body

    truth_rows: TruthRow[Array] = columns_of(TruthRow, rows)
    origin: OriginRow[Array] = columns_of(OriginRow, origins)
    since = np.searchsorted(np.nan_to_num(origin.since_s, nan=-np.inf), truth_rows.t_s, side="right")
    place = origin.place_deg_m[np.maximum(since - 1, 0)]
    position = pymap3d.geodetic2ned(*truth_rows.place_deg_m.T, *place.T)
    body = to_body(rotation_from_quaternion(*truth_rows.quaternion.T), *truth_rows.vel_ned_m_s.T)
    names = (*STATE, *RATES)
    columns = (*position, *body, *truth_rows.quaternion.T, *truth_rows.rate_frd_rad_s.T)
    return {"t_s": truth_rows.t_s, **dict(zip(names, map(np.asarray, columns), strict=True))}
