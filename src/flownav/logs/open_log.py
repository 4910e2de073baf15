"""Any recorded flight as a Log: the format is found from a path's first bytes, and its reader is imported then."""

from collections.abc import Mapping
from dataclasses import replace
from importlib import import_module
from pathlib import Path

from flownav.core.errors import InputError, arg
from flownav.core.guard import an_input
from flownav.core.measurement import Sensor
from flownav.logs.crazyflie_blocks import looks_like as looks_like_crazyflie
from flownav.logs.dataflash.text_form import is_text
from flownav.logs.heights_alike import upside_down
from flownav.logs.journal import MAGIC as JOURNAL_MAGIC
from flownav.logs.journal import SUFFIX as JOURNAL_SUFFIX
from flownav.logs.log import Log
from flownav.logs.references import examined
from flownav.logs.seen_motion import moves_as_seen
from flownav.logs.topic_files import is_topic_folder

KNOWN = (
    "a folder of CSV files (flownav's, or ulog2csv's), a PX4 ULog (.ulg), an ArduPilot DataFlash log (.bin, or .log as "
    "text), a MAVLink telemetry log (.tlog), a ROS bag (a folder, .db3, .mcap, .bag), a Crazyflie's log, a Betaflight "
    "or INAV blackbox, or a live session's record (.fnr)"
)
READERS = {
    "ulog": ("ulog", "read_ulog"),
    "dataflash": ("dataflash", "read_dataflash"),
    "tlog": ("mavlink_log", "read_tlog"),
    "record": ("record_log", "read_live_record"),
    "crazyflie": ("crazyflie", "read_crazyflie"),
    "blackbox": ("blackbox.reader", "read_blackbox"),
}
ULOG_MAGIC = b"\x55\x4c\x6f\x67\x01\x12\x35"
DATAFLASH_MAGIC = b"\xa3\x95"
DATAFLASH_FORMAT = b"\xa3\x95\x80"  # the message that describes others: a log that has lost its start still has many
BLACKBOX_START = b"H Product:Blackbox flight data recorder"
BAG_MAGICS = (b"\x89MCAP0\r\n", b"SQLite format 3\0", b"#ROSBAG V2.0\n")
ZIP_MAGIC = b"PK\x03\x04"
MAVLINK_MAGIC = b"\xfd\xfe"
LOOKED_AT_BYTES = 4096
YEARS_US = (1.0e15, 4.2e15)  # microseconds of the years 2001 to 2103


def open_log(path: Path, *, flow_instance: int | None = None, topics: Mapping[str, str] | None = None) -> Log:
    """Read a recorded flight of any known format; its reference is examined (`logs/references.py`, `seen_motion.py`):
    what cannot be is left out, leaps are taken back, each with a note.

    flow_instance: which of several flow sensors; None takes the one with most readings. topics: of a ROS bag, which
    topic serves as what, by role. InputError where the path is missing or no known format, or the log cannot be read.
    """
    log = _read(path, flow_instance, topics)
    if log.truth is None:
        return log
    if witness := upside_down(log.truth, log.streams):
        shows = "show" if " and " in witness else "shows"
        note = f"{log.truth_name} is left out: its down points up, as {witness} {shows}; give it with z downwards"
        return replace(log, truth=None, heading_truth=None, notes=(*log.notes, note))
    truth, notes = examined(log.truth, log.truth_name, log.streams.get(Sensor.IMU))
    if len(log.truth["t_s"]) and not len(truth["t_s"]):
        note = f"{log.truth_name} is left out: none of its rows is a place within 100 km; metres are needed"
        return replace(log, truth=None, heading_truth=None, notes=(*log.notes, note))
    return moves_as_seen(replace(log, truth=truth, notes=(*log.notes, *notes)) if notes else log)


def _read(path: Path, flow_instance: int | None, topics: Mapping[str, str] | None) -> Log:
    """A log as its reader makes it."""
    from flownav.logs.ros.containers import is_bag_folder

    folder = an_input(path).is_dir()
    kind = ("ros" if is_bag_folder(path) else "") if folder else log_kind(path)
    if kind == "ros":
        from flownav.logs.ros.reader import read_ros

        return read_ros(path, flow_instance=flow_instance, topics=topics)
    if topics:
        raise InputError(f"{arg('topics')}: {path} is no ROS bag; leave it out")
    if folder and is_topic_folder(path):
        from flownav.logs.ulog_csv import read_topic_folder

        return read_topic_folder(path, flow_instance=flow_instance)
    if folder:
        if flow_instance is not None:
            raise InputError(
                f"{arg('flow_instance')}: {path} is a folder of CSV files, with one flow sensor; leave it out"
            )
        from flownav.logs.csv_folder import read_csv_folder

        return read_csv_folder(path)
    journal = path if kind == "journal" else path.with_name(path.name + JOURNAL_SUFFIX)
    if kind == "journal" or (not path.exists() and journal.exists()):
        raise InputError(
            f"{journal}: the journal of a session that did not end; `flownav recover {journal}` makes its record"
        )
    if not kind:
        raise InputError(f"{path}: {'not a log that is known' if path.exists() else 'no such log'}; give {KNOWN}")
    module, reader = READERS[kind]
    log: Log = getattr(import_module(f"flownav.logs.{module}"), reader)(path, flow_instance=flow_instance)
    return log


def open_flight(path: Path, *, flow_instance: int | None = None, topics: Mapping[str, str] | None = None) -> Log:
    """A log that can be replayed. InputError, besides open_log's, where it lacks what a replay cannot do without."""
    log = open_log(path, flow_instance=flow_instance, topics=topics)
    lacking = [] if log.streams.keys() & {Sensor.ATTITUDE, Sensor.IMU} else ["an attitude or an IMU"]
    if not log.streams.keys() & {Sensor.GPS_POSITION, Sensor.FLOW_RATE, Sensor.FLOW_VELOCITY}:
        lacking.append("GPS or optical flow")
    if lacking:
        raise InputError(
            f"{path}: the log lacks {' and '.join(lacking)}, which a replay needs; `flownav info` shows what it holds"
        )
    return log


def log_kind(path: Path) -> str:
    """The kind of a log file, by its first bytes and its suffix; "" for anything else.

    "ulog", "dataflash", "tlog", "ros" (a bag of ROS), "crazyflie", "blackbox", "record" or "journal".

    InputError where a file cannot be read, or is a FIFO or a device.
    """
    if not an_input(path).is_file():
        return ""
    try:
        with path.open("rb") as file:
            head = file.read(LOOKED_AT_BYTES)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); see who may read it") from error
    if head.startswith(JOURNAL_MAGIC):
        return "journal"
    if head.startswith(ULOG_MAGIC) or path.suffix.lower() == ".ulg":
        return "ulog"
    if head.startswith(BAG_MAGICS) or path.suffix.lower() in (".mcap", ".db3"):
        return "ros"
    if head.startswith(DATAFLASH_MAGIC) or (path.suffix.lower() == ".bin" and DATAFLASH_FORMAT in head):
        return "dataflash"
    if is_text(head):
        return "dataflash"
    if path.suffix.lower() == ".fnr" and head.startswith(ZIP_MAGIC):
        return "record"
    if BLACKBOX_START in head:
        return "blackbox"
    if looks_like_crazyflie(head):
        return "crazyflie"
    dated = YEARS_US[0] < int.from_bytes(head[:8], "big") < YEARS_US[1]
    if path.suffix.lower() == ".tlog" or (dated and len(head) > 8 and head[8] in MAVLINK_MAGIC):
        return "tlog"
    return ""
