"""Flights whose pad camera is rendered and searched, frame by frame, in the closed loop.

The kernel flies whole flights and cannot stop for a frame. But a flight is the same bytes whenever it is flown, and
what is seen in a frame moves nothing before the navigator takes that reading. So the flight is flown up to a frame, the
frame is rendered from where the vehicle then is, the detector's fix goes into a table that the kernel reads in place of
the pad camera's model, and the flight is flown again from its start, a frame or two farther. In the end its navigator
has used exactly the fixes of its detector. Every other sensor is the model's.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import norm

from flownav.core.compile import announce_compilation
from flownav.core.errors import InputError
from flownav.core.measurement import Array, Sensor
from flownav.core.record import POSITION_NED, QUATERNION, TABLES, VELOCITY_BODY
from flownav.lab.optics import pad_trial
from flownav.lab.optics.pad import BOARD_CELLS, NESTED_CELLS, TAG_CELLS, PadTarget
from flownav.lab.optics.pad_fix import fix_error, is_wrong, truth_of
from flownav.lab.optics.projection import FlightMotion, Pose
from flownav.sensors.camera_sheets import PadCameraSheet
from flownav.sensors.pad_camera import PadCameraParameters, angle_noise, distance_noise
from flownav.simulation.assemble import Setup
from flownav.simulation.engine import fly_one
from flownav.simulation.ensemble import Ensemble
from flownav.simulation.history import columns
from flownav.simulation.onboard import EPOCH_S, PAD_SEEN
from flownav.simulation.truth import PUNCTUAL

LOWEST_LENS_M = 0.11  # below that a lens all but touches the pad: no frame is rendered
ABOVE_RANGE = 1.5  # nor from higher than this multiple of the datasheet's greatest height
FARTHEST_RAD = 1.3  # from the axis
LOOK_AHEAD = 25  # frames ahead that the flight goes on while there is nothing to render
MOTION = (*POSITION_NED, *VELOCITY_BODY, *QUATERNION, *TABLES["truth"][10:13])


class PixelFrame(NamedTuple):
    """One rendered frame of a flight and what the detector made of it; error (4,) as `pad_truth.fix_error` or NaN.

    shown_m: the reach of the tag that the datasheet's detector uses there, for the inner's size; whole: it is in view.
    """

    t_s: float
    height_m: float
    shown_m: float
    image_rate_rad_s: float
    whole: bool
    found: bool
    wrong: bool
    reason: str
    error: Array


class Eye(NamedTuple):
    """The camera of one flight: as `pad_trial` draws it, turned against the body by its mounting, and where it sits."""

    flown: pad_trial.CameraFlight
    mounting: Array
    lens_m: Array
    late_s: float
    highest_m: float


def fly_on_pixels(
    setup: Setup, seed: int, index: int = 0, ensemble: Ensemble | None = None,
    on_progress: Callable[[float], None] = lambda t_s: None,
) -> tuple[Setup, list[PixelFrame]]:  # fmt: skip
    """The setup whose flight `index` uses the fixes found in its rendered frames, and those frames.

    InputError where the flight has no pad camera, or one that `flownav pad` did not measure.
    """
    eye, flight = eye_of(setup, seed, index, ensemble), setup.flight
    assert flight.onboard is not None
    clock, taken = flight.onboard.carried.pad_camera.clock, taken_epochs(setup)
    epochs = np.arange(clock.first, flight.plan.epochs, clock.every)[: len(taken)]
    seen = np.zeros((len(epochs), PAD_SEEN))
    frames: list[PixelFrame] = []
    k = 0
    with announce_compilation("single-flight"):
        while k < len(epochs):
            motion = _flown(setup, seen, seed, index, ensemble, int(epochs[min(k + LOOK_AHEAD, len(epochs) - 1)]) + 1)
            until = None
            while k < len(epochs) and epochs[k] < len(motion) and (until is None or epochs[k] <= until):
                found = frame_of(eye, motion[epochs[k]], float(epochs[k]) * EPOCH_S, k)
                if found is not None:
                    frames.append(found[0])
                    seen[k] = found[1]
                    until = taken[k] if until is None else until
                k += 1
            on_progress(min(k, len(epochs)) / len(epochs))
    return _on(setup, seen), frames


def eye_of(setup: Setup, seed: int, index: int, ensemble: Ensemble | None) -> Eye:
    """The camera of flight `index`, with a calibration, a mounting, light and a pad of its own."""
    sheet = setup.fitted.sheets.pad_camera if setup.fitted is not None else None
    if sheet is None:
        raise InputError(f"{setup.scenario.name}: optics = pixels needs a pad camera: [pad_fix], and the navigator")
    if not sheet.camera or sheet.side_m == 0.0:
        raise InputError(f"{sheet.name}: names no camera to render; measure one with `flownav pad --out`")
    trial, target = pad_trial.camera_named(sheet.camera), target_of(sheet)
    flown = pad_trial.camera_flight(trial, target, seed, index)
    rng = np.random.default_rng([seed, index, 31])
    turn = mounting_rad(sheet, flown) * rng.standard_normal(3)
    late = PUNCTUAL if ensemble is None else ensemble.truths(seed, index, 1)[0].late
    place = setup.flight.onboard.carried.pad_camera.place if setup.flight.onboard is not None else (0.0, 0.0, 0.0)
    return Eye(
        flown, Rotation.from_rotvec(turn).as_matrix(), np.array(place), late.pad_camera,
        ABOVE_RANGE * float(sheet.max_height_m) * float(sheet.ratio),
    )  # fmt: skip


def target_of(sheet: PadCameraSheet) -> PadTarget:
    """The tag that a datasheet is of, nested where there is a larger one round it. InputError for another ratio."""
    side_m = float(sheet.side_m) * TAG_CELLS / BOARD_CELLS
    if sheet.ratio not in (1.0, NESTED_CELLS):
        raise InputError(f"{sheet.name}: ratio = {sheet.ratio:g}; a tag to render has 1, a nested one {NESTED_CELLS}")
    return PadTarget(side_m) if sheet.ratio == 1.0 else PadTarget(side_m * NESTED_CELLS, "nested")


def mounting_rad(sheet: PadCameraSheet, flown: pad_trial.CameraFlight) -> float:
    """The datasheet's boresight less the calibration's share, which the frames have."""
    calibration = pad_trial.camera_named(sheet.camera).calibration.centre_px / flown.optic.lens.focal_px
    return float(np.sqrt(max(np.radians(sheet.boresight_deg) ** 2 - calibration**2, 0.0)))


def taken_epochs(setup: Setup) -> NDArray[np.int64]:
    """The epoch in which the navigator takes each of the pad camera's readings."""
    table = setup.flight.table
    assert table is not None
    return np.asarray(table.epoch[table.sensor == Sensor.PAD])


def _on(setup: Setup, seen: Array) -> Setup:
    assert setup.flight.onboard is not None
    onboard = setup.flight.onboard._replace(pad_seen=seen.ravel())
    return replace(setup, flight=setup.flight._replace(onboard=onboard))


def _flown(setup: Setup, seen: Array, seed: int, index: int, ensemble: Ensemble | None, epochs: int) -> Array:
    """How the vehicle has moved until then, (epochs, len(MOTION))."""
    flight = _on(setup, seen).flight
    flight = flight._replace(plan=flight.plan._replace(epochs=min(epochs, flight.plan.epochs)))
    return np.asarray(fly_one(flight, seed, index, ensemble)[:, columns("truth", MOTION), 0])


def frame_of(eye: Eye, motion: Array, t_s: float, number: int) -> tuple[PixelFrame, Array] | None:
    """The frame of this instant and the row of the table that it makes; None where none is rendered."""
    pose, moving = pose_of(eye, motion)
    if not LOWEST_LENS_M < pose.height_m < eye.highest_m or not pad_ahead(pose):
        return None
    flown = eye.flown
    frame = pad_trial.take_frame(flown, pad_trial.ground_below(flown, pose.height_m), pose, moving, number)
    fix, reason = pad_trial.look(flown, frame)
    truth = truth_of(pose_of(eye, motion, mounted=False)[0], flown.target)
    rate = pad_trial.rate_of(pose, moving)
    shown_m, whole = shown(eye, pose)
    if fix is None:
        none = PixelFrame(t_s, pose.height_m, shown_m, rate, whole, False, False, reason, np.full(4, np.nan))
        return none, np.zeros(PAD_SEEN)
    error = fix_error(fix, truth)
    wrong = is_wrong(error, truth, flown.target.inner)
    ratio = fix.side_m / flown.target.inner.side_m
    seen = np.array([fix.tan_forward, fix.tan_right, fix.distance_m, fix.distance_m**2 / pose.height_m / ratio])
    return PixelFrame(t_s, pose.height_m, shown_m, rate, whole, not wrong, wrong, reason, error), seen


def shown(eye: Eye, pose: Pose) -> tuple[float, bool]:
    """The reach of the inner tag where it is whole in view and near, else the outer's, and whether it is whole."""
    flown = eye.flown
    inner = truth_of(pose, flown.target.inner)
    if pad_trial.whole_in_view(flown.optic, inner) and inner.reach_m <= eye.highest_m / flown_ratio(eye) / ABOVE_RANGE:
        return inner.reach_m, True
    return inner.reach_m / flown_ratio(eye), pad_trial.whole_in_view(flown.optic, truth_of(pose, flown.target))


def flown_ratio(eye: Eye) -> float:
    """How much larger the outer tag is than the inner, 1 where there is none."""
    return eye.flown.target.side_m / eye.flown.target.inner.side_m


def pad_ahead(pose: Pose) -> bool:
    """Whether the pad lies near enough to the optical axis to be in any frame of a wide lens."""
    x, y, z = np.array(pose[3:]).reshape(3, 3).T @ np.array([-pose.x_m, -pose.y_m, pose.height_m])
    return bool(np.arctan2(np.hypot(x, y), z) < FARTHEST_RAD)


def pose_of(eye: Eye, motion: Array, *, mounted: bool = True) -> tuple[Pose, FlightMotion]:
    """Where the lens is over the pad, how it looks, and how it moves; mounted False: as if its mounting were right."""
    place, velocity, (w, x, y, z), rates = motion[:3], motion[3:6], motion[6:10], motion[10:13]
    body = Rotation.from_quat([x, y, z, w]).as_matrix()
    lens = place + body @ eye.lens_m - eye.late_s * (body @ velocity)
    moving = body @ (velocity + np.cross(rates, eye.lens_m))
    looking = body @ eye.mounting if mounted else body
    own = eye.mounting.T @ rates
    pose = Pose(float(lens[0]), float(lens[1]), float(-lens[2]), *map(float, looking.ravel()))
    return pose, FlightMotion(*map(float, moving), *map(float, own))


# -- held against the datasheet ---------------------------------------------------------------------------------------
BANDS_M = (0.0, 0.3, 0.6, 1.2, 2.4, 4.8, 100.0)


def agreement(frames: list[PixelFrame], sheet: PadCameraSheet) -> list[dict[str, Any]]:
    """By height: the detections and their errors in the frames, next to the datasheet's values for the same frames.

    expected_found: by its chances, of the frames with the whole pad in view; *_rms: of errors with their bias, and
    expected_*: noise and bias of the datasheet at the same heights and rates. None where there is no frame.
    """
    p = sheet.parameters()
    rows = []
    for low, high in pairwise(BANDS_M):
        own = [f for f in frames if low <= f.height_m < high]
        whole, found = [f for f in own if f.whole], [f for f in own if f.found]
        if not own:
            continue
        errors = np.array([f.error for f in found]).reshape(-1, 4)
        rows.append(
            {
                "from_m": low,
                "to_m": high,
                "frames": len(own),
                "in_view": len(whole),
                "found": sum(f.found for f in whole),
                "expected_found": float(sum(chance_of(p, f) for f in whole)),
                "wrong": sum(f.wrong for f in own),
                "angle_rms_rad": _rms(errors[:, :2]),
                "expected_angle_rad": _rms(np.array([angle_of(p, f) for f in found])),
                "distance_rms": _rms(errors[:, 2]),
                "expected_distance": _rms(np.array([distance_of(p, f) for f in found])),
            }
        )
    return rows


def chance_of(p: PadCameraParameters, f: PixelFrame) -> float:
    """That the datasheet's detector finds the pad in this frame, in which the whole pad is."""
    if f.height_m < p.min_height_m or f.shown_m > p.max_height_m:
        return 0.0
    level = p.missed_above - p.missed_by_height * f.shown_m / p.max_height_m - p.missed_per_rad_s * f.image_rate_rad_s
    return float(norm.cdf(level) * norm.cdf(p.hidden_above))


def angle_of(p: PadCameraParameters, f: PixelFrame) -> float:
    """Noise and boresight of an angle [rad]."""
    return float(np.hypot(angle_noise(p, f.shown_m, f.image_rate_rad_s), p.boresight_rad))


def distance_of(p: PadCameraParameters, f: PixelFrame) -> float:
    """Noise and scale of the distance."""
    return float(np.hypot(distance_noise(p, f.shown_m, f.image_rate_rad_s), p.scale))


def _rms(values: Array) -> float | None:
    return float(np.sqrt((values**2).mean())) if values.size else None
