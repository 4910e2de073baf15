"""What a session leaves behind: everything the navigator was fed, as it was fed, and what it made of it.

Rows go to files beside the record as they come, so that memory does not grow; `finish` makes the Record of them.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from flownav.live.options import Options
from flownav.mavlink.state_messages import TrueState
from flownav.measurement import COLUMNS, MAX_VALUES, Array, EventQueue, Sensor
from flownav.navigation.tables import estimate_table, fed_rows, fed_table, happenings, innovation_table, states_table
from flownav.navigation.tape import ESTIMATE_COLUMNS, OFFER_COLUMNS
from flownav.navigation.told import Equipment
from flownav.provenance import command_line, provenance
from flownav.record import FED, POSITION_NED, QUATERNION, VELOCITY_BODY, Record, Table

NAN = float("nan")
WIDTHS = {"fed": len(FED), "estimate": ESTIMATE_COLUMNS, "innovation": len(OFFER_COLUMNS), "event": 3, "truth": 14}
MOST_NOTES = 100_000


class Recorder:
    """A Chronicle that keeps all. OSError where its files cannot be written."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._folder = path.with_name(f".{path.name}.spool")
        shutil.rmtree(self._folder, ignore_errors=True)
        self._folder.mkdir(parents=True)
        self._files: dict[str, BinaryIO] = {name: self._spool(name).open("wb") for name in WIDTHS}
        self._segments: list[dict[str, Any]] = []
        self._notes: list[tuple[float, str, str, str, float]] = []
        self._notes_lost = 0

    def _spool(self, name: str) -> Path:
        return self._folder / name

    def segment(self, equipment: Equipment) -> None:
        """A navigator begins; what is fed from now on is fed to it."""
        self._segments.append(equipment._asdict())

    def fed(self, queue: EventQueue, arrival_s: Array) -> None:
        """A batch."""
        self._files["fed"].write(fed_rows(queue, arrival_s, len(self._segments) - 1).tobytes())

    def written(self, estimate: Array, innovation: Array, event: Array) -> None:
        """What came of it."""
        for name, rows in (("estimate", estimate), ("innovation", innovation), ("event", event)):
            if len(rows):
                self._files[name].write(np.ascontiguousarray(rows).tobytes())

    def note(self, t_s: float, source: str, kind: str, detail: str, value: float = NAN) -> None:
        """A happening; the first MOST_NOTES are kept."""
        if len(self._notes) < MOST_NOTES:
            self._notes.append((t_s, source, kind, detail, value))
        else:
            self._notes_lost += 1

    def truth(self, t_s: float, state: TrueState) -> None:
        """Position is geodetic until the origin is known, at the end."""
        row = (t_s, *state.position_deg_m, *state.vel_ned_m_s, *state.quaternion, *state.rate_frd_rad_s)
        self._files["truth"].write(np.array(row).tobytes())

    def _rows(self, name: str) -> Array:
        self._files[name].close()
        return np.fromfile(self._spool(name)).reshape(-1, WIDTHS[name])

    def finish(
        self, options: Options, origin_deg_m: tuple[float, float, float] | None, facts: dict[str, Any]
    ) -> Record:
        """Write the record, whole, and remove what it was made of. `facts`: the session's own figures."""
        fed, events = self._rows("fed"), self._rows("event")
        record = Record(self._manifest(options, origin_deg_m, facts, fed))
        estimate = self._rows("estimate")
        record.add("estimate", estimate_table(estimate))
        record.add("states", states_table(estimate))
        record.add("fed", fed_table(fed))
        for sensor in Sensor:
            rows = fed[fed[:, FED.index("sensor")] == sensor]
            if len(rows):
                record.add(sensor.name.lower(), _readings(sensor, rows))
        truth = self._rows("truth")
        if len(truth) and origin_deg_m is not None:
            record.add("truth", _truth(truth, origin_deg_m))
        record.add("innovation", innovation_table(self._rows("innovation")))
        record.add("events", self._events(events))
        record.save(self.path)
        shutil.rmtree(self._folder, ignore_errors=True)
        return record

    def _manifest(
        self, options: Options, origin: tuple[float, float, float] | None, facts: dict[str, Any], fed: Array
    ) -> dict[str, Any]:
        return {
            "kind": "live",
            "filter": "landing",
            "duration_s": float(fed[-1, 0] - fed[0, 0]) if len(fed) else 0.0,
            "parameters": {
                "filter": options.settings.model_dump(),
                "gps_delay_s": options.gps_delay_s,
                "horizon_s": options.least_horizon_s,
                "flow_sensor": options.identified._asdict() if options.identified else None,
                **({"flow_noise": options.flow_noise._asdict()} if options.flow_noise.stated else {}),
                **({} if origin is None else {"origin_lat_lon_deg_alt_m": list(origin)}),
            },
            "segments": self._segments,
            "live": facts,
            "provenance": provenance(),
            "command": command_line(),
            "scores": {},
        }

    def _events(self, rows: Array) -> dict[str, Any]:
        events = happenings(rows) + self._notes
        if self._notes_lost:
            events.append((events[-1][0], "live", "notes_lost", "happenings beyond these", float(self._notes_lost)))
        events.sort(key=lambda event: event[0])
        columns = list(zip(*events, strict=True)) or [()] * 5
        kinds = (float, str, str, str, float)
        names = ("t_s", "source", "kind", "detail", "value")
        return {name: np.array(column, kind) for name, column, kind in zip(names, columns, kinds, strict=True)}

    def discard(self) -> None:
        """Nothing came of it."""
        for file in self._files.values():
            file.close()
        shutil.rmtree(self._folder, ignore_errors=True)


class NoRecorder:
    """A Chronicle that keeps nothing."""

    def segment(self, equipment: Equipment) -> None:
        """Nothing."""

    def fed(self, queue: EventQueue, arrival_s: Array) -> None:
        """Nothing."""

    def written(self, estimate: Array, innovation: Array, event: Array) -> None:
        """Nothing."""

    def note(self, t_s: float, source: str, kind: str, detail: str, value: float = NAN) -> None:
        """Nothing."""

    def truth(self, t_s: float, state: TrueState) -> None:
        """Nothing."""


def _readings(sensor: Sensor, rows: Array) -> Table:
    """A sensor's own table: by arrival, as other records have it."""
    first = FED.index("value_0")
    columns = dict(zip(COLUMNS[sensor], rows[:, first : first + MAX_VALUES].T, strict=False))
    return {"t_s": rows[:, FED.index("arrival_s")], **columns, "quality": rows[:, FED.index("quality")]}


def _truth(rows: Array, origin_deg_m: tuple[float, float, float]) -> Table:
    """Position in the local frame, velocity in body axes."""
    import pymap3d

    from flownav.frames import rotation_from_quaternion, to_body

    position = pymap3d.geodetic2ned(*rows[:, 1:4].T, *origin_deg_m)
    rotation = rotation_from_quaternion(*rows[:, 7:11].T)
    body = to_body(rotation, *rows[:, 4:7].T)
    names = (*POSITION_NED, *VELOCITY_BODY, *QUATERNION, "rate_p_rad_s", "rate_q_rad_s", "rate_r_rad_s")
    columns = (*position, *body, *rows[:, 7:11].T, *rows[:, 11:14].T)
    return {"t_s": rows[:, 0], **dict(zip(names, map(np.asarray, columns), strict=True))}
