"""A folder of CSV files, one a sensor, as a Log. docs/reference/csv-folder.md is the format.

Units stand in the column names; time is seconds of one clock; body axes are forward-right-down, the flow is in
PX4's sensor convention. Sensors a folder lacks are left out; one of `attitude.csv` and `imu.csv`, and one of
`gps.csv`, `flow.csv`, `px4flow.csv` must be there.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from flownav.core.errors import InputError
from flownav.core.frames import quaternion_from_euler
from flownav.core.guard import an_input
from flownav.core.measurement import COLUMNS, Sensor, Stream
from flownav.core.record import POSITION_NED, Table
from flownav.logs.assembly import local_position, near_the_rest, origin_of, readings_once
from flownav.logs.csv_table import Column, CsvTable, read_csv_table
from flownav.logs.log import Log, absences_of
from flownav.logs.plausible import check_plausible

HALF_TURN = np.pi + 0.01
GYRO_LIMIT_RAD_S = 70.0  # twice the range of a 2000 deg/s gyro
RADIANS = "radians are needed (degrees?)"
METRES = "metres are needed (millimetres? centimetres?)"
DEGREES = "degrees are needed (degrees * 1e7?)"

FILES: dict[str, tuple[Column, ...]] = {
    "attitude": (
        Column("roll_rad", -HALF_TURN, HALF_TURN, RADIANS),
        Column("pitch_rad", -HALF_TURN / 2, HALF_TURN / 2, RADIANS),
        Column("yaw_rad", -2 * HALF_TURN, 2 * HALF_TURN, RADIANS),
    ),
    "imu": (
        *(Column(f"gyro_{axis}_rad_s", -GYRO_LIMIT_RAD_S, GYRO_LIMIT_RAD_S, "radians per second") for axis in "xyz"),
        *(Column(f"accel_{axis}_m_s2", -400.0, 400.0, "metres per second squared (mg?)") for axis in "xyz"),
    ),
    "gps": (
        Column("fix_type", 0, 8, "GPS fix types run from 0 to 8"),
        Column("lat_deg", -90.0, 90.0, DEGREES),
        Column("lon_deg", -180.0, 180.0, DEGREES),
        Column("alt_m", -1000.0, 20000.0, METRES),
        *(
            Column(f"vel_{axis}_m_s", -150.0, 150.0, "metres per second (centimetres?)", may_be_empty=True)
            for axis in "ned"
        ),
    ),
    "flow": (
        *(Column(f"flow_{axis}_rad_s", -GYRO_LIMIT_RAD_S, GYRO_LIMIT_RAD_S, "radians per second") for axis in "xy"),
        *(
            Column(f"gyro_{axis}_rad_s", -GYRO_LIMIT_RAD_S, GYRO_LIMIT_RAD_S, "radians per second", False, True)
            for axis in "xy"
        ),
        Column("quality", 0, 255, "quality runs from 0 (no data) to 255"),
    ),
    "px4flow": (
        *(Column(f"flow_comp_m_{axis}_m_s", -150.0, 150.0, "metres per second") for axis in "xy"),
        Column("ground_distance_m", -1.0, 200.0, METRES),
        Column("quality", 0, 255, "quality runs from 0 (no data) to 255"),
    ),
    "range": (Column("range_m", -1.0, 200.0, METRES), Column("valid", 0, 1, "valid is 0 or 1")),
    "baro": (Column("alt_m", -1000.0, 20000.0, "metres of altitude are needed (pascal?)"),),
    "mag": tuple(Column(f"mag_{axis}_mgauss", -2e4, 2e4, "milligauss are needed (nanotesla?)") for axis in "xyz"),
    "landed": (Column("landed", 0, 1, "landed is 0 or 1"),),
    "truth": tuple(Column(f"{axis}_m", -1e5, 1e5, METRES) for axis in "xyz"),
    "heading_truth": (Column("yaw_rad", -10 * HALF_TURN, 10 * HALF_TURN, RADIANS),),  # may be counted on over turns
}
SELDOM = ("landed",)  # written only at events


def read_csv_folder(folder: Path) -> Log:
    """Read every known file of a folder.

    InputError, one line, where the folder or a needed file is missing, a file cannot be read or lacks a
    column, or its numbers cannot be in the units that the names state. Bad rows are counted in
    `Stream.rejected`, by reason.
    """
    tables = _tables(folder)
    streams: dict[Sensor, Stream] = {}
    for name, convert in CONVERTERS.items():
        if name in tables:
            streams.update({stream.sensor: stream for stream in convert(tables[name])})
    _check_overlap(folder, tables)
    check_plausible(folder, streams)
    origin = origin_of(tables["gps"]) if "gps" in tables else None
    return Log(
        folder, streams, origin,
        _columns(tables.get("truth"), dict(zip(POSITION_NED, ("x_m", "y_m", "z_m"), strict=True))),
        {f"{name}.csv": table.sha256 for name, table in tables.items()},
        tuple(note for table in tables.values() for note in table.notes), absences=tuple(absences_of(streams)),
        heading_truth=_columns(tables.get("heading_truth"), {"yaw_rad": "yaw_rad"}),
    )  # fmt: skip


def _tables(folder: Path) -> dict[str, CsvTable]:
    if not an_input(folder).is_dir():
        raise InputError(f"{folder}: no such folder; replay takes a folder of CSV files (docs/reference/csv-folder.md)")
    present = {name for name in FILES if (folder / f"{name}.csv").exists()}
    moved, aided = present & {"attitude", "imu"}, present & {"gps", "flow", "px4flow"}
    if not moved or not aided:
        lacking = [*([] if moved else ["one of attitude.csv, imu.csv"])]
        lacking += [] if aided else ["one of gps.csv, flow.csv, px4flow.csv"]
        raise InputError(
            f"{folder}: {' and '.join(lacking)} missing; a replay needs attitude.csv or imu.csv (of 20 Hz), and "
            "gps.csv or flow.csv (or px4flow.csv); range.csv (flow's height), baro.csv, mag.csv, landed.csv, truth.csv "
            "and heading_truth.csv are used where present"
        )
    if "flow" in present:
        present -= {"px4flow"}  # the same sensor again, in its other message
    return {
        name: read_csv_table(folder / f"{name}.csv", FILES[name], seldom=name in SELDOM)
        for name in FILES
        if name in present
    }


def _check_overlap(folder: Path, tables: dict[str, CsvTable]) -> None:
    """Sensors of one flight share a clock: their times must meet the attitude's, or the IMU's where there is none."""
    common = "attitude" if "attitude" in tables else "imu"
    clock = tables[common].t_s
    for name, table in tables.items():
        if table.t_s[-1] < clock[0] or table.t_s[0] > clock[-1]:
            raise InputError(
                f"{folder}: {name}.csv covers {table.t_s[0]:g} to {table.t_s[-1]:g} s and {common}.csv "
                f"{clock[0]:g} to {clock[-1]:g} s; all files need one clock, in seconds"
            )


def _columns(table: CsvTable | None, names: dict[str, str]) -> Table | None:
    """Columns of a table under a record's names; None without the table."""
    return None if table is None else {"t_s": table.t_s, **{name: table.columns[of] for name, of in names.items()}}


# -- a file's streams --------------------------------------------------------------------------------------
def _attitude(table: CsvTable) -> list[Stream]:
    angles = table.matrix("roll_rad", "pitch_rad", "yaw_rad")
    quaternion = np.column_stack(quaternion_from_euler(*angles.T))
    return [Stream.of(Sensor.ATTITUDE, table.t_s, quaternion, rejected=table.rejected)]


def _gps(table: CsvTable) -> list[Stream]:
    """Velocity first: a filter that starts at a fix then knows how fast. None where no cell of it has one."""
    table.keep(table.columns["fix_type"] >= 3, "no_fix")
    if not len(table.t_s):
        raise InputError(f"{table.path}: no row has a 3-D fix (fix_type 3 or more); remove the file to replay without")
    table.keep(near_the_rest(table.columns["lat_deg"], table.columns["lon_deg"]), "out_of_range")
    velocity = table.stream(Sensor.GPS_VELOCITY, *COLUMNS[Sensor.GPS_VELOCITY])
    position = Stream.of(Sensor.GPS_POSITION, table.t_s, local_position(table), rejected=table.rejected)
    return [velocity, position] if np.isfinite(velocity.value).any() else [position]


def _px4flow(table: CsvTable) -> list[Stream]:
    """MAVLink OPTICAL_FLOW: velocity compensated and scaled in the sensor, and the sonar's distance."""
    names = ("flow_comp_m_x_m_s", "flow_comp_m_y_m_s", "flow_comp_m_z_m_s")
    return [
        table.stream(Sensor.FLOW_VELOCITY, *names, quality="quality"),
        Stream.of(Sensor.RANGE, table.t_s, table.matrix("ground_distance_m")),
    ]


def _range(table: CsvTable) -> list[Stream]:
    table.keep(table.columns["valid"] > 0, "invalid")
    return [table.stream(Sensor.RANGE, "range_m")]


def _baro(table: CsvTable) -> list[Stream]:
    table.keep(readings_once(table.t_s, table.matrix("alt_m")), "repeated")
    return [table.stream(Sensor.BARO, "alt_m")]


def _mag(table: CsvTable) -> list[Stream]:
    names = ("mag_x_mgauss", "mag_y_mgauss", "mag_z_mgauss")
    table.keep(readings_once(table.t_s, table.matrix(*names)), "repeated")
    field = 1e-3 * table.matrix(*names)
    return [Stream.of(Sensor.MAG, table.t_s, field, rejected=table.rejected)]


CONVERTERS: dict[str, Callable[[CsvTable], list[Stream]]] = {
    "attitude": _attitude,
    "imu": lambda table: [table.stream(Sensor.IMU, *COLUMNS[Sensor.IMU])],
    "gps": _gps,
    "px4flow": _px4flow,
    "flow": lambda table: [table.stream(Sensor.FLOW_RATE, *COLUMNS[Sensor.FLOW_RATE], quality="quality")],
    "range": _range,
    "baro": _baro,
    "mag": _mag,
    "landed": lambda table: [table.stream(Sensor.LANDED, "landed")],
}
