"""Pictures of single flights: landings, estimates and their errors, faults, the smoother."""

from __future__ import annotations

import numpy as np
from drawing import COLOURS, axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch

import flownav


def paths() -> Figure:
    """Height over time of the scenarios that ship, as they are flown."""
    figure, axis = axes()
    for name in ("takeoff", "landing", "pad_return", "approach"):
        truth = flownav.fly(name, seed=1).tables["truth"]
        axis.plot(truth["t_s"], -truth["pos_d_m"], label=name)
    axis.set(xlabel="time [s]", ylabel="height of the skids [m]")
    axis.legend()
    return figure


def white_and_real_gps() -> Figure:
    """Error north of the paper's filter in one landing: with the paper's white noise, and with a real receiver's."""
    figure, axis = axes()
    for model, label in (("midg", "receiver of 2 m CEP"), ("white", "white noise, as in the paper")):
        record = flownav.fly("landing", seed=1, filter="paper", gps=model)
        t, error = _error(record, "pos_n_m")
        axis.plot(t, error, label=label)
    axis.set(xlabel="time [s]", ylabel="error north [m]")
    axis.legend()
    return figure


def error_and_band() -> Figure:
    """Error of the landing filter on an approach, and twice the standard deviation that it states."""
    record = flownav.fly("approach", seed=2)
    figure, rows = axes(3, 1, 4.6, sharex=True)
    for axis, column, name in zip(rows, ("pos_n_m", "pos_e_m", "pos_d_m"), ("north", "east", "down"), strict=True):
        t, error = _error(record, column)
        std = record.tables["estimate"][f"std_{column}"]
        axis.fill_between(t, -2 * std, 2 * std, color=COLOURS[0], alpha=0.18, linewidth=0, label="± 2 std, as stated")
        axis.plot(t, error, label="error")
        axis.set_ylabel(f"{name} [m]")
    figure.legend(*rows[0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
    rows[-1].set_xlabel("time [s]")
    return figure


def pad_seen() -> Figure:
    """The position relative to the pad as the vehicle takes it to be, before and after a camera first sees the pad."""
    record = flownav.fly("approach", seed=1)
    flown, truth = record.tables["flown"], record.tables["truth"]
    first_s = record.tables["pad"]["t_s"][0]
    figure, axis = axes()
    for column, name in (("pos_n_m", "north"), ("pos_e_m", "east")):
        error = flown[column] - np.interp(flown["t_s"], truth["t_s"], truth[column])
        axis.plot(flown["t_s"], error, label=name)
    axis.axvline(first_s, color=COLOURS[4], linestyle=":")
    axis.annotate("first pad fix", (first_s, axis.get_ylim()[1]), xytext=(4, -10), textcoords="offset points")
    axis.set(xlabel="time [s]", ylabel="error relative to the pad [m]")
    axis.legend(loc="lower right")
    return figure


def protection_level() -> Figure:
    """Horizontal error of an approach below its protection level."""
    record = flownav.fly("approach", seed=3)
    t, north = _error(record, "pos_n_m")
    _, east = _error(record, "pos_e_m")
    figure, axis = axes()
    axis.plot(t, record.tables["estimate"]["protection_horizontal_m"], label="protection level", color=COLOURS[1])
    axis.plot(t, np.hypot(north, east), label="error", color=COLOURS[0])
    axis.set(xlabel="time [s]", ylabel="horizontal [m]", ylim=(0, None))
    axis.legend()
    return figure


def biases_learnt() -> Figure:
    """Two states of the landing filter with their standard deviations: a gyro's bias, and the slow error of GPS."""
    states = flownav.fly("approach", seed=1).tables["states"]
    figure, two = axes(1, 2, 2.8)
    for axis, column, factor, label in (
        (two[0], "gyro_bias_x_rad_s", 180 / np.pi, "gyro bias, forward axis [°/s]"),
        (two[1], "gps_slow_n_m", 1.0, "slow GPS error north [m]"),
    ):
        value, std = factor * states[column], factor * states[f"std_{column}"]
        axis.fill_between(states["t_s"], value - 2 * std, value + 2 * std, alpha=0.18, linewidth=0)
        axis.plot(states["t_s"], value)
        axis.set(xlabel="time [s]", ylabel=label)
    return figure


def smoothed_outage() -> Figure:
    """Standard deviation of the position through a GPS outage of the sample flight: of the filter, and smoothed."""
    record = _sample_replay(gps_outages=[(30, 75)], smooth=True)
    figure, axis = axes()
    for name, label in (("estimate", "filter"), ("smoothed", "smoothed")):
        table = record.tables[name]
        axis.plot(table["t_s"], np.hypot(table["std_pos_n_m"], table["std_pos_e_m"]), label=label)
    axis.axvspan(30, 75, color=COLOURS[4], alpha=0.12, linewidth=0, label="without GPS")
    axis.set(xlabel="time [s]", ylabel="horizontal standard deviation [m]", ylim=(0, None))
    axis.legend()
    return figure


def horizon() -> Figure:
    """When readings arrive, and when they are fused: the navigator's horizon lies behind the present."""
    figure, axis = axes(height=2.2)
    axis.set_axis_off()
    axis.set(xlim=(-0.02, 1.06), ylim=(-0.6, 3.1))
    for row, (name, age, every) in enumerate(
        (("GPS, 0.22 s old", 0.22, 0.2), ("flow, 0.08 s old", 0.08, 0.1), ("IMU, fresh", 0.005, 0.025))
    ):
        for described in np.arange(0.12, 0.76, every):
            arrives = described + age
            seen = arrives <= 0.8
            axis.plot(described, row, "o", markersize=3.5, color=COLOURS[row] if seen else "#d1d5db")
            if row < 2:
                arrow = FancyArrowPatch((described, row), (arrives, row + 0.34), arrowstyle="-|>", mutation_scale=6,
                                        color=COLOURS[row] if seen else "#d1d5db", linewidth=0.7)  # fmt: skip
                axis.add_patch(arrow)
        axis.text(-0.02, row + 0.1, name, fontsize=8)
    for place, text in ((0.55, "horizon:\nfused up to here"), (0.8, "now")):
        axis.axvline(place, ymin=0.05, ymax=0.9, color="#374151", linewidth=1)
        axis.text(place + 0.008, 2.62, text, fontsize=8, va="bottom")
    axis.annotate("", (0.8, -0.4), (0.55, -0.4), arrowprops={"arrowstyle": "-|>", "color": "#374151"})
    axis.text(0.675, -0.33, "carried by the IMU", fontsize=8, ha="center", va="bottom")
    return figure


def gps_drifts_off() -> Figure:
    """A flight whose GPS position drifts off at 0.5 m/s from 20 s on, beside the same flight without the fault."""
    from flownav.campaigns.faults.catalogue import FAULTS
    from flownav.campaigns.faults.flown import law_of_flight, scenario_flown
    from flownav.parts.flying import fly_with
    from flownav.parts.protocols import Parts
    from flownav.simulation.assemble import assemble

    setup = assemble(scenario_flown(3.0))
    fault = law_of_flight(FAULTS["gps_drift"], (20.0, 45.0), 1, 0, 0.02)
    figure, axis = axes()
    for law, label in ((None, "sound"), (fault, "GPS drifts off at 0.5 m/s")):
        record = flownav.Record.of(fly_with(setup, Parts(), 1, fault=law))
        t, north = _error(record, "pos_n_m")
        _, east = _error(record, "pos_e_m")
        begins = int(np.searchsorted(t, 20.0))
        shown = t > 10.0
        axis.plot(t[shown], np.hypot(north - north[begins], east - east[begins])[shown], label=label)
    axis.axvspan(20, 45, color=COLOURS[4], alpha=0.12, linewidth=0, label="fault")
    axis.set(xlabel="time [s]", ylabel="position moved off since 20 s [m]", ylim=(0, None))
    axis.legend()
    return figure


def _error(record: flownav.Record, column: str, table: str = "estimate") -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) [s] of a record's estimate and its error (n,) against the truth."""
    estimate, truth = record.tables[table], record.tables["truth"]
    return estimate["t_s"], estimate[column] - np.interp(estimate["t_s"], truth["t_s"], truth[column])


def _folder():
    from pathlib import Path
    from tempfile import TemporaryDirectory

    class Folder(TemporaryDirectory):
        def __enter__(self):
            return Path(super().__enter__())

    return Folder()


def _sample_replay(**options: object) -> flownav.Record:
    """The sample flight of `flownav sample ulog`, replayed."""
    from flownav.export.samples.kinds import sample_of

    with _folder() as folder:
        log = folder / "flight.ulg"
        sample_of("ulog").write(1, log)
        return flownav.replay(log, **options)
