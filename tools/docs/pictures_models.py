"""Pictures of the models: vehicle, control, sensors, optics, rig."""

from __future__ import annotations

import numpy as np
from drawing import axes
from matplotlib.figure import Figure

import flownav


def ground_effect() -> Figure:
    """Thrust gained near the ground, of the paper's helicopter, at three airspeeds."""
    from flownav.vehicle.rotor import multiplier
    from flownav.vehicle.sheet import vehicle_sheet

    sheet = vehicle_sheet(None)
    induced, radius = sheet.trim.induced_velocity_m_s, flownav.Vehicle.load("maxi-joker-3").file.main_rotor.radius_m
    heights = np.linspace(0.5, 3.0, 120)
    figure, axis = axes()
    for airspeed in (0.0, 3.0, 6.0):
        gained = [100 * (multiplier(h * radius, airspeed, induced, radius) - 1) for h in heights]
        axis.plot(heights, gained, label=f"airspeed {airspeed:.0f} m/s")
    axis.set(xlabel="height of the rotor hub over the rotor's radius", ylabel="thrust gained [%]")
    axis.legend()
    return figure


def margins() -> Figure:
    """Phase margin of every loop of the autopilot: at the stated parameters, and at the worst corner of the
    uncertainty box.
    """
    from flownav.control.margins import LEAST_PHASE_DEG, margins_over_box

    rows = margins_over_box(None).rows
    loops = list(dict.fromkeys(row.loop for row in rows))
    told = [next(row.margins.phase_deg for row in rows if row.loop == loop) for loop in loops]
    least = [min(row.margins.phase_deg for row in rows if row.loop == loop) for loop in loops]
    shown = [i for i in range(len(loops)) if np.isfinite(told[i])]
    figure, axis = axes(height=0.32 * len(shown) + 1.0)
    for place, i in enumerate(shown):
        axis.plot([least[i], told[i]], [place, place], color="#9ca3af", zorder=1)
    axis.scatter([told[i] for i in shown], range(len(shown)), label="as stated", zorder=2)
    axis.scatter([least[i] for i in shown], range(len(shown)), label="least over the box", zorder=2)
    axis.axvline(LEAST_PHASE_DEG, color="#6b7280", linestyle=":", label=f"{LEAST_PHASE_DEG:.0f}° asked")
    axis.set_yticks(range(len(shown)), [loops[i] for i in shown])
    axis.invert_yaxis()
    axis.set_xlabel("phase margin [°]")
    axis.legend(loc="lower right")
    return figure


def gps_errors() -> Figure:
    """The errors of two GPS models at a vehicle whose place is known: white noise, and a receiver of 2 m CEP."""
    figure, axis = axes()
    for model in ("midg", "white"):
        record = flownav.fly("landing", seed=1, filter="paper", gps=model, autopilot="truth")
        table, truth = record.tables["gps_position"], record.tables["truth"]
        north_m = np.interp(table["t_s"], truth["t_s"], truth["pos_n_m"])
        axis.plot(
            table["t_s"], table["pos_n_m"] - north_m, label={"midg": "receiver of 2 m CEP", "white": "white"}[model]
        )
    axis.set(xlabel="time [s]", ylabel="GPS error north [m]")
    axis.legend()
    return figure


def flow_noise() -> Figure:
    """Standard deviation of a velocity reading of the paper's flow sensor over its height."""
    sensor = flownav.Sensor.load("px4flow-paper")
    heights = np.linspace(0.3, 5.0, 100)
    figure, axis = axes(height=2.6)
    axis.plot(heights, [sensor.sigma_m_s(float(h)) for h in heights])
    axis.set(xlabel="height [m]", ylabel="noise of a velocity reading [m/s]", ylim=(0, None))
    return figure


def pads() -> Figure:
    """The patterns of the optics: the paper's stripes, a random texture, a chessboard with grain."""
    from flownav.lab.optics.pad import checker, stripes, texture

    figure, three = axes(1, 3, 2.6)
    for axis, pad in zip(three, (stripes(), texture(), checker()), strict=True):
        side = 400  # texels of 0.25 mm
        tiled = np.tile(pad.reflectance, (side // len(pad.reflectance) + 1, side // pad.reflectance.shape[1] + 1))
        axis.imshow(
            tiled[:side, :side],
            cmap="gray",
            vmin=0,
            vmax=1,
            extent=(0, side * pad.texel_m * 100, 0, side * pad.texel_m * 100),
        )
        axis.set(title=pad.name, xlabel="cm")
        axis.grid(False)
    return figure


def pad_target() -> Figure:
    """The nested landing target as it is printed, and in frames of a camera from 6 m and from 2.5 m."""
    from flownav.lab.optics.pad import PadTarget, printed_cells
    from flownav.lab.optics.pad_trial import CAMERAS, camera_flight, camera_named, frames_at, look

    target = PadTarget(1.0, "nested", 0)
    flown = camera_flight(camera_named(next(iter(CAMERAS))), target, seed=1, flight=0)
    figure, three = axes(1, 3, 2.5)
    three[0].imshow(printed_cells(target), cmap="gray")
    three[0].set_title("printed")
    for axis, height in zip(three[1:], (6.0, 2.5), strict=True):
        frame, _, _ = next(iter(frames_at(flown, height, 0.5, 1, seed=2)))
        fix, reason = look(flown, frame)
        axis.imshow(frame, cmap="gray")
        axis.set_title(
            f"from {height:g} m: {reason or 'found'}"
            if fix is None
            else f"from {height:g} m: found at {fix.distance_m:.2f} m"
        )
    for axis in three:
        axis.set_axis_off()
    return figure


def rig() -> Figure:
    """One run of the pendulum: the encoder's velocity and the flow sensor's, which is smaller and late."""
    from flownav.lab.rig.experiment import RigSettings, run_experiment

    log = run_experiment(RigSettings(height_m=0.6, seed=1))
    seen = (log.time_s > 2.0) & (log.time_s < 6.0)
    figure, axis = axes(height=2.6)
    axis.plot(log.time_s[seen], log.reference_velocity_m_s[seen], label="encoder")
    axis.plot(log.time_s[seen], log.flow_velocity_m_s[seen], label="flow sensor")
    axis.set(xlabel="time [s]", ylabel="velocity [m/s]")
    axis.legend(loc="upper right")
    return figure
