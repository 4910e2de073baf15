"""The C interface: structs, enumerations and functions, written from the records that the navigator itself has."""

import json
import re
from collections.abc import Iterable, Iterator
from itertools import pairwise
from textwrap import fill
from typing import Any, NamedTuple, get_type_hints

from flownav.core.compile import places_of, width_of
from flownav.core.measurement import COLUMNS, Sensor
from flownav.core.version import __version__
from flownav.estimation.gating import Reason
from flownav.estimation.hypotheses import NAMES as FAULTS
from flownav.estimation.states import STATES
from flownav.navigation import onboard, progress, waiting, waiting_records
from flownav.navigation.memory import LAST_ESTIMATE
from flownav.navigation.now import NowRow
from flownav.navigation.packed import PARTS, START_SIGMA
from flownav.navigation.rows import EventRow, InnovationRow
from flownav.navigation.tape import EVENT_NAMES

ABI = 1  # of structs and functions; another one does not link, since it is in the functions' names
SYMBOLS = {name: f"flownav_abi{ABI}_{name}" for name in ("begin", "take", "now", "digest")}
BEFORE = 1.5  # exposures before the instant that a flow reading describes, its middle: from two before its end on
SPARE = 5  # rows more: one at each end, and readings that come a little sooner than by their rate
WORDS = {  # where a record's own words are of Python
    "status": "see enum flownav_now_status; the rest stands only where it is FLOWNAV_TOLD",
    "aid": "0: something horizontal was fused lately; 1: dead reckoning; 2: the position is invalid",
    "suspected": "0, or 1 and a number of enum flownav_fault",
}


OURS = {  # what Python's words for them are in C
    "`measurement.COLUMNS`": "enum flownav_sensor", "`measurement.Sensor`": "enum flownav_sensor",
    "`gating.Reason`": "enum flownav_reason", "a place in `tape.EVENT_NAMES`": "of enum flownav_event_kind",
    "`STATUSES`": "enum flownav_status", "`progress.NOW_STATUSES`": "enum flownav_now_status",
    "`hypotheses.NAMES`": "enum flownav_fault",
}  # fmt: skip


class Rates(NamedTuple):
    """Capacity of the rings: a horizon [s]; readings a second of the IMU, of all others together, and of an external
    attitude where no IMU serves; the longest exposure of a flow sensor [s], whose turning is to be found.
    """

    horizon_s: float = 0.27
    imu_hz: float = 100.0
    others_hz: float = 100.0
    attitude_hz: float = 0.0
    exposure_s: float = 0.1

    @property
    def sizes(self) -> waiting_records.Sizes:
        """Rows: what comes within the horizon and four more, and for a flow's turning what came before (`turning`)."""
        kept_s = self.horizon_s + BEFORE * self.exposure_s
        return waiting_records.Sizes(
            float(int(kept_s * self.imu_hz) + SPARE),
            float(int(self.horizon_s * self.others_hz) + SPARE),
            float(int(kept_s * self.attitude_hz) + SPARE) if self.attitude_hz > 0.0 else 0.0,
            8192.0,
        )


def counts(record: Any) -> Iterator[tuple[str, int]]:
    """Each field of a record, and how many numbers it takes."""
    places = [*places_of(record), width_of(record)]
    return zip(record._fields, (b - a for a, b in pairwise(places)), strict=True)


def comment(text: str, indent: str = "") -> str:
    """A comment of C, wrapped."""
    for python, c in OURS.items():
        text = text.replace(python, c)
    words = re.sub(r"\s+", " ", text.replace("`", "").strip())
    return fill(f"/* {words} */", 110, initial_indent=indent, subsequent_indent=f"{indent}   ")


def struct(name: str, record: Any, about: str = "") -> str:
    """A record as a struct of doubles."""
    fields = "".join(
        f"  double {field}{f'[{count}]' if count > 1 else ''};{f'  /* {WORDS[field]} */' if field in WORDS else ''}\n"
        for field, count in counts(record)
    )
    size = f"FLOWNAV_ASSERT(sizeof({name}) == {8 * width_of(record)}, {name});"
    return f"{comment(about or record.__doc__ or '')}\ntypedef struct {name} {{\n{fields}}} {name};\n{size}\n"


def enumeration(name: str, members: Iterable[tuple[str, int, str]]) -> str:
    """An enumeration with what each member means."""
    lines = "".join(
        f"  FLOWNAV_{member} = {value},{f'  /* {what} */' if what else ''}\n" for member, value, what in members
    )
    return f"enum {name} {{\n{lines}}};\n"


# -- settings -----------------------------------------------------------------------------------------------
def settings_structs() -> str:
    """The settings, part by part, and the whole."""
    written: list[str] = []
    for part, record in PARTS.items():
        written.append(_settings_struct(f"flownav_{part}_settings", record, written))
    parts = "".join(f"  flownav_{part}_settings {part};\n" for part in PARTS)
    sigma = f"  double start_sigma[{STATES}];  /* standard deviations of the error states before the first reading */\n"
    pace = "".join(f"  double {name};\n" for name in progress.Pace._fields)
    numbers = START_SIGMA + STATES + len(progress.Pace._fields)
    about = "All settings of a navigator. " + (progress.Pace.__doc__ or "")
    return (
        "\n".join(written)
        + f"\n{comment(about)}\ntypedef struct flownav_settings {{\n{parts}{sigma}{pace}}} flownav_settings;\n"
        + f"FLOWNAV_ASSERT(sizeof(flownav_settings) == {8 * numbers}, flownav_settings);\n"
    )


def _settings_struct(name: str, record: Any, written: list[str]) -> str:
    """One part; a record within it is a struct before it."""
    lines = []
    for field, kind in get_type_hints(record).items():
        if hasattr(kind, "_fields"):
            inner = f"{name.removesuffix('_settings')}_{field}_settings"
            written.append(_settings_struct(inner, kind, written))
            lines.append(f"  {inner} {field};\n")
        else:
            lines.append(f"  double {field};{'  /* 0 or 1 */' if kind is bool else ''}\n")
    return f"{comment(record.__doc__ or '')}\ntypedef struct {name} {{\n{''.join(lines)}}} {name};\n"


# -- the whole header ---------------------------------------------------------------------------------------
def sensors() -> Iterator[tuple[str, int, str]]:
    """The sensors and what their values are."""
    for sensor in Sensor:
        yield sensor.name, int(sensor), ", ".join(COLUMNS[sensor])


def events() -> Iterator[tuple[str, int, str]]:
    """Happenings, and what their value is."""
    for number, (source, kind, what) in enumerate(EVENT_NAMES):
        yield f"EVENT_{source}_{kind}".upper(), number, what


def header(sizes: waiting_records.Sizes, build: str = "") -> str:
    """`flownav.h` for rings of these sizes. build: the hash of everything, where there is one."""
    from jinja2 import Environment, PackageLoader

    page = Environment(loader=PackageLoader(__package__, "files"), keep_trailing_newline=True, autoescape=False)
    return page.get_template("flownav.h.j2").render(
        abi=ABI,
        version=__version__,
        build=build,
        sizes=sizes,
        work_rows=progress.BOARD_ROWS,
        ring_rows=waiting.rows_of(sizes),
        most_innovations=onboard.MOST_INNOVATIONS,
        most_events=onboard.MOST_EVENTS,
        symbols=SYMBOLS,
        sensors=enumeration("flownav_sensor", sensors()),
        statuses=enumeration("flownav_status", ((n, *v) for n, v in (*progress.STATUSES.items(), ("FAULT", FAULT)))),
        now_statuses=enumeration("flownav_now_status", ((n, *v) for n, v in progress.NOW_STATUSES.items())),
        reasons=enumeration("flownav_reason", ((f"REASON_{r.name}", int(r), "") for r in Reason)),
        events=enumeration("flownav_event_kind", events()),
        faults=enumeration("flownav_fault", ((_fault(name), i, name) for i, name in enumerate(FAULTS))),
        reading=struct("flownav_reading", waiting_records.BoardReading),
        innovation=struct("flownav_innovation", InnovationRow),
        event=struct("flownav_event", EventRow),
        state=struct("flownav_state", NowRow),
        outcome=_outcome(),
        settings=settings_structs(),
    )


OUTCOME_NUMBERS = (
    len(onboard.OutcomeHead._fields)
    + onboard.MOST_INNOVATIONS * width_of(InnovationRow)
    + onboard.MOST_EVENTS * width_of(EventRow)
)
FAULT = (-1, "the code within has failed, which it never should: begin anew")


def _fault(name: str) -> str:
    return "FAULT_" + name.replace(" ", "_").upper()


def _outcome() -> str:
    """Declaration of a call's outcome: its head, and rows."""
    head = "".join(f"  double {name};\n" for name in onboard.OutcomeHead._fields)
    rows = (
        f"  flownav_innovation innovation[{onboard.MOST_INNOVATIONS}];\n  flownav_event event[{onboard.MOST_EVENTS}];\n"
    )
    return (
        f"{comment(onboard.OutcomeHead.__doc__ or '')}\n"
        f"typedef struct flownav_outcome {{\n{head}{rows}}} flownav_outcome;\n"
        f"FLOWNAV_ASSERT(sizeof(flownav_outcome) == {8 * OUTCOME_NUMBERS}, flownav_outcome);\n"
    )


def script() -> dict[str, Any]:
    """Source of `flownav.js`: enumerations, and where numbers lie."""
    enumerations = {
        "SENSOR": [(sensor.name, int(sensor)) for sensor in Sensor],
        "STATUS": [(name, value) for name, (value, _) in progress.STATUSES.items()],
        "NOW_STATUS": [(name, value) for name, (value, _) in progress.NOW_STATUSES.items()],
        "REASON": [(reason.name, int(reason)) for reason in Reason],
    }
    records = {"state": NowRow, "innovation": InnovationRow, "event": EventRow, "head": onboard.OutcomeHead}
    numbers = {
        "reading": width_of(waiting_records.BoardReading), "innovations": onboard.MOST_INNOVATIONS,
        "events": onboard.MOST_EVENTS, "work": progress.BOARD_ROWS, "first_row": waiting.FIRST_ROW,
        "inertial": waiting.INERTIAL, "stored": waiting.STORED, "told": waiting.ATTITUDE_FIELDS,
    }  # fmt: skip
    layouts = {
        name: json.dumps(
            [[field, first, count] for (field, count), first in zip(counts(record), places_of(record), strict=False)]
        )
        for name, record in records.items()
    }
    places = {
        "pace": {name: progress.PACE + i for i, name in enumerate(progress.Pace._fields)},
        "equipment": {name: place_of_part("equipment") + i for i, name in enumerate(PARTS["equipment"]._fields)},
        "rows": {"last_estimate": LAST_ESTIMATE},
    }
    return {
        "enumerations": enumerations, "layouts": layouts, "numbers": numbers,
        "places": {name: json.dumps(place) for name, place in places.items()},
    }  # fmt: skip


def place_of_part(part: str) -> int:
    """Where a part of the packed settings begins."""
    names = list(PARTS)
    return sum(_width(PARTS[name]) for name in names[: names.index(part)])


def _width(record: Any) -> int:
    """How many numbers a part takes, with the records within it."""
    return sum(_width(kind) if hasattr(kind, "_fields") else 1 for kind in get_type_hints(record).values())
