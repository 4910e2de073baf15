"""Position, velocity, attitude and controls in time (the paper's figures 17 to 25); the path over the ground."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.measurement import COLUMNS, Array, Sensor
from flownav.core.record import POSITION_NED, QUATERNION, VELOCITY_BODY, Record
from flownav.report import series
from flownav.report.chart import LINE_POINTS, Stack, sliding_mean, sliding_rms, thin
from flownav.report.panels import Panel, listed
from flownav.report.series import Track, Window, at, estimates, has, moments, outages, readings, track

POSITION_TITLES = ("x, north (m)", "y, east (m)", "z, down (m)")
VELOCITY_TITLES = ("u, forward (m/s)", "v, right (m/s)", "w, down (m/s)")
REFERENCE = ("pos_n_ref_m", "pos_e_ref_m", "pos_d_ref_m")
PLACED = (
    "The autopilot's input is the navigator's estimate carried to the present; it counts from where the vehicle takes "
    "its pad to be, the estimate from the filter's origin."
)
DOWN = "z is positive down (NED); its axis is drawn upside down, so that up on the page is up."


class View(NamedTuple):
    """A panel's key and title, the window of time [s] it shows (all where None), whether GPS is shown at once."""

    key: str
    title: str
    window: Window | None = None
    with_gps: bool = True


class Source(NamedTuple):
    """Something to draw: the role it is coloured by, its name in the legend, and its values."""

    role: str
    name: str
    track: Track | None


POSITION = View("position", "Position")
VELOCITY = View("velocity", "Velocity")


def position(record: Record, view: View = POSITION) -> Panel:
    """Position x, y, z: GPS readings, estimate, truth (figures 17 and 22)."""
    dots = [Source("gps", "GPS", readings(record, Sensor.GPS_POSITION))]
    lines = [Source("command", "reference", track(record, "command", REFERENCE))]
    lines += [Source("command", "set-point", series.setpoints(record, POSITION_NED))]
    lines += [Source(*source) for source in series.estimates(record, POSITION_NED)]
    note = DOWN if view.with_gps else ""
    note += f" {PLACED}" if has(record, "flown") and view.with_gps else ""
    return _states(record, POSITION_TITLES, dots, lines, view, note)


def velocity(record: Record, view: View = VELOCITY) -> Panel:
    """Body velocity u, v, w: flow, estimate, truth (figures 18 to 25)."""
    lines = [Source(*source) for source in series.estimates(record, VELOCITY_BODY)]
    flow = series.flow_velocity(record)
    name = "flow sensor" if has(record, "flow_velocity") else "flow \N{MULTIPLICATION SIGN} range"
    dots = [Source("flow", name, flow)]
    if not has(record, "truth", VELOCITY_BODY):
        dots.insert(0, Source("gps", "GPS velocity", series.gps_velocity_body(record)))
    note = "Body axes: forward, right, down."
    if flow is None:
        fused = series.flow_readings(record) is not None
        note += f" The record holds no {'range for its' if fused else 'valid'} flow readings."
    elif np.isnan(flow.value[:, 2]).all():
        note += " The flow sensor does not measure w."
    return _states(record, VELOCITY_TITLES, dots, lines, view, note)


def _states(
    record: Record, titles: tuple[str, ...], dots: list[Source], lines: list[Source], view: View, note: str
) -> Panel:
    if all(line.role == "command" for line in lines):
        return Panel(view.key, view.title, absent="The record holds no estimate and no truth of these states.")
    stack = Stack(titles)
    for role, name, source in dots:
        for row, t_s, values in _rows(source, view.window):
            stack.dots(row, role, name, t_s, values, shown=view.with_gps)
    for role, name, source in lines:
        for row, t_s, values in _rows(source, view.window):
            stack.line(row, role, name, t_s, values)
    if titles is POSITION_TITLES:
        stack.reverse(3)
    span = view.window or series.start_end_s(record)
    figure = stack.chart(span, moments(record), outages(record))
    alt = f"{view.title} from {span[0]:.0f} to {span[1]:.0f} s: {', '.join(titles)}. "
    return Panel(view.key, view.title, note, f"{alt}Drawn: {listed(stack.names)}.", figure)


def _rows(source: Track | None, window: Window | None) -> Iterator[tuple[int, Array, Array]]:
    """Each component of a track inside a window, as (row from 1, t_s, values)."""
    if source is not None:
        shown = source.within(window)
        for row, values in enumerate(shown.value.T, 1):
            yield row, shown.t_s, values


LEAST_IMU_HZ = 20.0
SLOW_S, SHAKEN_S = 0.3, 1.0
ATTITUDE_POINTS = 6000  # rows of an attitude that are turned into angles
CONTROLS = {
    "lon_rad": "longitudinal (°)",
    "lat_rad": "lateral (°)",
    "col_rad": "collective (°)",
    "ped_rad": "pedal (°)",
}


def attitude(record: Record) -> Panel:
    """Roll, pitch and yaw [deg] of truth, estimate and autopilot; of the attitude sensor where none of them has any."""
    key, title = "attitude", "Attitude"
    sources, own = series.estimates(record, QUATERNION), readings(record, Sensor.ATTITUDE)
    if not sources and own is not None:
        sources = [("estimate", "attitude sensor", own)]
    if not sources:
        return Panel(key, title, absent="The record holds no attitude.")
    asked = series.setpoints(record, QUATERNION)
    sources = sources if asked is None else [("command", "set-point", asked), *sources]
    stack = Stack(("roll (°)", "pitch (°)", "yaw (°)"))
    for role, name, source in sources:
        kept = thin(ATTITUDE_POINTS, *source.value[:, 1:].T)
        angles = series.euler_deg(Track(source.t_s[kept], source.value[kept]))
        for row in (1, 2, 3):
            stack.line(row, role, name, source.t_s[kept], _unbroken(angles[:, row - 1], row == 3))
    figure = stack.chart(series.start_end_s(record), moments(record))
    return Panel(key, title, "Z-Y-X Euler angles of body against earth; drawn in degrees.",
                 f"Roll, pitch and yaw in degrees: {listed(stack.names)}.", figure)  # fmt: skip


def _unbroken(angle_deg: np.ndarray, is_yaw: bool) -> np.ndarray:
    """A yaw that does not leap at +-180 degrees."""
    if not is_yaw or np.isnan(angle_deg).any():
        return angle_deg
    return np.unwrap(angle_deg, period=360.0)


def controls(record: Record) -> Panel:
    """The controls [deg] and, where known, the rotor thrust [N]."""
    key, title = "controls", "Controls"
    columns = [name for name in CONTROLS if track(record, "command", (name,)) is not None]
    thrust = track(record, "truth", ("thrust_n",))
    if not columns and thrust is None:
        return Panel(key, title, absent="The record holds no commands.")
    titles = [CONTROLS[name] for name in columns] + (["thrust (N)"] if thrust is not None else [])
    stack = Stack(titles, row_height_px=118)
    for row, name in enumerate(columns, 1):
        command = track(record, "command", (name,))
        if command is not None:
            stack.line(row, "estimate", "command", command.t_s, np.degrees(command.value[:, 0]))
    if thrust is not None:
        stack.line(len(titles), "truth", "true thrust", thrust.t_s, thrust.value[:, 0])
    figure = stack.chart(series.start_end_s(record), moments(record))
    return Panel(key, title, "Angles of the swash plate and the blades, as commanded.",
                 f"Controls over time: {listed(titles)}.", figure)  # fmt: skip


def vibration(record: Record) -> list[Panel]:
    """How much the vehicle shakes its IMU: what is faster than a slow mean, rms over a sliding window; none without."""
    imu = track(record, "imu", COLUMNS[Sensor.IMU])
    if imu is None or len(imu.t_s) < 2 or (len(imu.t_s) - 1) / max(np.ptp(imu.t_s), 1e-9) < LEAST_IMU_HZ:
        return []
    stack = Stack(("accelerometer (m/s²)", "gyro (°/s)"), row_height_px=120)
    shaken = []
    for row, columns, scale in ((1, slice(3, 6), 1.0), (2, slice(0, 3), 57.29577951308232)):
        fast = [values - sliding_mean(imu.t_s, values, SLOW_S) for values in imu.value[:, columns].T]
        squares = np.nan_to_num(np.sum(np.square(fast), axis=0))
        shaken.append(scale * sliding_rms(imu.t_s, squares, SHAKEN_S))
        stack.line(row, "imu", "vibration", imu.t_s, shaken[-1])
    stack.from_zero()
    caption = (
        f"Length of what the IMU reads beyond its mean over {SLOW_S:g} s, rms over a sliding {SHAKEN_S:g} s: "
        f"in the median {np.median(shaken[0]):.2f} m/s² and {np.median(shaken[1]):.2f} °/s, "
        f"at most {np.max(shaken[0]):.2f} m/s² and {np.max(shaken[1]):.2f} °/s."
    )
    chart = stack.chart(series.start_end_s(record), moments(record), outages(record))
    return [Panel("vibration", "Vibration", caption, f"Vibration of the IMU over time. {caption}", chart)]


BATTERY = {"voltage_v": "voltage (V)", "current_a": "current (A)", "remaining_percent": "left (%)"}


def battery(record: Record) -> list[Panel]:
    """The battery as the log has it; none where it has no voltage."""
    present = [name for name in BATTERY if track(record, "battery", (name,)) is not None]
    known = [name for name in present if np.isfinite(record.tables["battery"][name]).any()]
    if "voltage_v" not in known:
        return []
    stack = Stack([BATTERY[name] for name in known], row_height_px=110)
    for row, name in enumerate(known, 1):
        values = np.asarray(record.tables["battery"][name], float)
        stack.line(row, "imu", "battery", np.asarray(record.tables["battery"]["t_s"], float), values)
    volts = np.asarray(record.tables["battery"]["voltage_v"], float)
    caption = f"From {volts[np.isfinite(volts)][0]:.2f} V to {volts[np.isfinite(volts)][-1]:.2f} V."
    chart = stack.chart(series.start_end_s(record), moments(record), outages(record))
    return [Panel("battery", "Battery", caption, f"Battery over time. {caption}", chart)]


JUMP_M = 0.5  # from one row to the next: the estimate in use jumps this far as a pad is found


class Pad(NamedTuple):
    """The landing pad: a square on the ground about the origin, length of a side [m]."""

    size_m: float

    def corners(self) -> Array:
        """North, east, down of the closed outline, shape (5, 3)."""
        half = 0.5 * self.size_m
        north, east = half * np.array([-1, 1, 1, -1, -1]), half * np.array([-1, -1, 1, 1, -1])
        return np.column_stack([north, east, np.zeros(5)])


@dataclass(frozen=True)
class Paths:
    """The paths that are drawn: (role, name, track NED [m]) with the truth last, GPS readings, the pad, the touchdown
    (3,).
    """

    tracks: tuple[tuple[str, str, Track], ...]
    gps: Track | None
    pad: Pad | None
    touch: Array | None
    outages: tuple[Window, ...]

    def main(self) -> tuple[str, str, Track]:
        """The path that stands for the vehicle: the truth's, or else the estimate's."""
        return self.tracks[-1]

    def names(self) -> list[str]:
        """The names of the drawn paths and places."""
        gps, where = ["GPS"] * (self.gps is not None), ["pad"] * (self.pad is not None)
        return [*where, *gps, *(name for _, name, _ in self.tracks), *["touchdown"] * (self.touch is not None)]


@dataclass(frozen=True)
class PathsView:
    """A way to look at the paths: from above, or in space."""

    paths: Paths
    from_where: Literal["above", "space"]


def pad(record: Record) -> Pad | None:
    """The pad of manifest["pad_size_m"], None where the record states none."""
    size_m = record.manifest.get("pad_size_m")
    return Pad(float(size_m)) if isinstance(size_m, (int, float)) else None


def paths_of(record: Record) -> Paths | None:
    """The paths of a record; None where it holds no position."""
    tracks = tuple(estimates(record, POSITION_NED))
    if not tracks:
        return None
    gps = readings(record, Sensor.GPS_POSITION)
    return Paths(tracks, gps, pad(record), _touchdown(record, tracks[-1][2]), tuple(outages(record)))


def _touchdown(record: Record, path: Track) -> Array | None:
    touch = next((m.t_s for m in moments(record) if m.name == "touchdown"), None)
    if touch is None:
        return None
    point = at(np.array([touch]), path)[0]
    return None if np.isnan(point).any() else point


def drawn_rows(role: str, path: Track) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows of a path that are drawn, and places among them before which it is open, as the estimate in use jumps."""
    steps = np.linalg.norm(np.diff(path.value, axis=0), axis=1) if role == "flown" else np.zeros(0)
    jumps = np.flatnonzero(steps > JUMP_M) + 1
    kept = np.union1d(thin(LINE_POINTS, *path.value.T), np.concatenate([jumps - 1, jumps]))
    return kept, np.searchsorted(kept, jumps)


def path_over_pad(record: Record) -> Panel:
    """3-D view of the path over the pad; height is drawn upwards."""
    paths = paths_of(record)
    key, title = "path-3d", "Path over the pad" if pad(record) else "Path in space"
    if paths is None:
        return Panel(key, title, absent="The record holds no positions.")
    caption = "Drag to turn, or use the arrow keys. The stem under the vehicle stands on the ground below it."
    where = ", over the pad" if paths.pad else ""
    alt = f"Path in space: {listed([name for _, name, _ in paths.tracks])}{where}."
    return Panel(key, title, caption, alt, PathsView(paths, "space"))


def ground_track(record: Record) -> Panel:
    """Top view: north up the page, east to the right, GPS readings, paths, pad, outages."""
    paths = paths_of(record)
    key, title = "ground-track", "Ground track"
    if paths is None:
        return Panel(key, title, absent="The record holds no positions.")
    caption = f"From above, {paths.main()[1]} coloured by time. Point at it to move to that instant."
    caption += f" The pad is {paths.pad.size_m:g} m square." if paths.pad else ""
    caption += f" {PLACED}" if has(record, "flown") else ""
    return Panel(key, title, caption, f"Path over the ground from above: {listed(paths.names())}.",
                 PathsView(paths, "above"))  # fmt: skip
