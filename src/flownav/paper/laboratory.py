"""Section III of the paper on the synthetic rig: runs from pixels, models identified from them, Tables 1, 2 and 3.

Seven runs a height, one second-order model from each, as Table 1 has them. Model k is validated on run k + 1 of its
height (the last on the first), which it has not seen. The selected model is the second of the lowest height, as the
paper's; at its own height it is not judged on the run that it comes from.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Array
from flownav.lab.identification.experiment import Experiment, experiment
from flownav.lab.identification.output_error import Fit, Structure, fit, fit_percent, simulate
from flownav.lab.identification.quantities import Excitation, excitation, latency_s
from flownav.lab.rig.experiment import RigLog, RigSettings, run_campaign
from flownav.paper import published
from flownav.paper.published import HEIGHTS_M, MODELS, ErrorRow
from flownav.sensors.datasheet import Dynamics
from flownav.sensors.processes import hold_step, second_order_hold

ORDERS = (0, 1, 2, 3, 4)
SECOND_ORDER = Structure(2)
OTHER_RUNS = 1
LIGHTS = ("low", "intense")


@dataclass(frozen=True)
class Configuration:
    """A way to set up the rig, the same at every height."""

    name: str
    words: str
    settings: RigSettings


@dataclass(frozen=True)
class Run:
    """A run and what was identified from it. fits by order (0: gain and delay alone)."""

    log: RigLog
    fits: dict[int, Fit]

    @property
    def height_m(self) -> float:
        """The sensor's height at rest."""
        return self.log.settings.height_m

    @property
    def dynamics(self) -> Dynamics:
        """The second-order model as a/(s^2 + b s + c)."""
        point = self.fits[2].point
        b, c = np.exp(point.log_a)
        return Dynamics(a_1_s2=point.gain * float(c), b_1_s=float(b), c_1_s2=float(c))

    @property
    def excitation(self) -> Excitation:
        """How many of the second-order model's parameters this run shows."""
        return excitation(self.fits[2])


@dataclass(frozen=True)
class OrderTest:
    """Mean fit [%] by order of a kind of run: on the runs identified from, and on the next run of the height."""

    kind: str
    height_m: float
    fits: dict[int, float]
    unseen: dict[int, float]


class Identified(NamedTuple):
    """Identification of one run with another set-up: fit [%], gain a/c, delay b/c [s]."""

    fit_percent: float
    gain: float
    delay_s: float


@dataclass(frozen=True)
class Laboratory:
    """The rig's runs, height by height, and the tests made with them. others: mean fit [%] by height; instruments: one
    run a height with another gyro or sonar.
    """

    fixed: Configuration
    runs: tuple[Run, ...]
    others: tuple[tuple[Configuration, dict[float, float]], ...] = ()
    orders: tuple[OrderTest, ...] = ()
    lights: tuple[RigLog, ...] = ()
    instruments: tuple[tuple[Configuration, dict[float, Identified]], ...] = ()

    def at(self, height_m: float) -> list[Run]:
        """The runs of a height, model 1 to 7."""
        return [run for run in self.runs if run.height_m == height_m]

    def mean_fit(self, height_m: float) -> float:
        """Mean fit [%] of the second-order models of a height."""
        return float(np.mean([run.fits[2].fit_percent for run in self.at(height_m)]))

    def spread(self, height_m: float) -> tuple[float, float]:
        """Smallest and largest of them."""
        fits = [run.fits[2].fit_percent for run in self.at(height_m)]
        return min(fits), max(fits)


def configurations(seed: int) -> tuple[Configuration, ...]:
    """The one that is fixed for all heights, then others beside it."""
    fixed = RigSettings(runs=MODELS, seed=seed)
    beside = replace(fixed, runs=OTHER_RUNS)
    return (
        Configuration("fixed", "the one used for every height", fixed),
        Configuration("lens at 0.6 m", "the lens left focused at 0.6 m", replace(beside, refocus=0.0)),
        Configuration(
            "exact gyro scale",
            "the 12.8 % error in the firmware's gyro scale repaired",
            replace(beside, firmware="2013-09,-gyro-scale"),
        ),
        Configuration("wider swing", "pushed to 0.13 rad, 0.50 m/s at 0.6 m", replace(beside, start_angle_rad=0.13)),
    )


def otherwise_instrumented(seed: int) -> tuple[Configuration, ...]:
    """The fixed set-up with a gyro or a sonar that errs less, or more: the effect of their errors on the
    identification.
    """
    one = RigSettings(runs=OTHER_RUNS, seed=seed)
    exact = "2013-09,-gyro-scale"
    late = "what PX4's estimator takes flow for where nobody says (EKF2_OF_DELAY)"
    echo = "an echo and a median of three more: one period of the sonar, as firmware 2014-12 has"
    return (
        Configuration("exact gyro scale", "no rotation leaks but by time", replace(one, firmware=exact)),
        Configuration("flow 20 ms older", f"than the gyro: {late}", replace(one, gyro_late_s=-0.020)),
        Configuration("gyro 20 ms older", "than the flow", replace(one, gyro_late_s=0.020)),
        Configuration("sonar at once", "no lag of the range that scales the flow", replace(one, sonar_late_s=0.0)),
        Configuration("sonar 150 ms late", echo, replace(one, sonar_late_s=0.150)),
    )


def rig_runs(whole: bool) -> int:
    """How many runs `swing` makes, for a progress bar."""
    tested = len(configurations(1)) - 1 + len(otherwise_instrumented(1))
    return len(HEIGHTS_M) * (MODELS + (OTHER_RUNS * tested + 1 if whole else 0)) + (len(LIGHTS) if whole else 0)


def swing(seed: int, whole: bool = True, on_run: Callable[[int], object] = lambda done: None) -> Laboratory:
    """Every run and identification. whole: with the other configurations, orders, chirps and lights of Table 1."""
    fixed, *beside = configurations(seed)
    orders = ORDERS if whole else (2,)
    runs = tuple(_identified(run_campaign(fixed.settings, HEIGHTS_M, on_run), orders))
    if not whole:
        return Laboratory(fixed, runs)
    others = tuple((other, _mean_fits(run_campaign(other.settings, HEIGHTS_M, on_run))) for other in beside)
    instruments = tuple(
        (other, _as_identified(run_campaign(other.settings, HEIGHTS_M, on_run)))
        for other in otherwise_instrumented(seed)
    )
    chirp = replace(fixed.settings, excitation="chirp", runs=1)
    swept = list(_identified(run_campaign(chirp, HEIGHTS_M, on_run), orders))
    tests = [_order_test("swing", [run for run in runs if run.height_m == height]) for height in HEIGHTS_M]
    tests += [_order_test("chirp", [run]) for run in swept]
    one = replace(fixed.settings, runs=1)
    lights = [log for light in LIGHTS for log in run_campaign(replace(one, light=light), HEIGHTS_M[:1], on_run)]
    return Laboratory(fixed, runs, others, tuple(tests), tuple(lights), instruments)


def _experiment(log: RigLog) -> Experiment:
    name = f"{log.settings.height_m:.1f} m, run {log.run}"
    return experiment(
        name, log.time_s, log.reference_velocity_m_s, log.time_s, log.flow_velocity_m_s, log.settings.height_m
    )


def _identified(logs: Iterable[RigLog], orders: Sequence[int]) -> Iterable[Run]:
    for log in logs:
        yield Run(log, {order: fit([_experiment(log)], Structure(order)) for order in orders})


def _mean_fits(logs: Iterable[RigLog]) -> dict[float, float]:
    fits: dict[float, list[float]] = {}
    for run in _identified(logs, (2,)):
        fits.setdefault(run.height_m, []).append(run.fits[2].fit_percent)
    return {height: float(np.mean(values)) for height, values in fits.items()}


def _as_identified(logs: Iterable[RigLog]) -> dict[float, Identified]:
    return {run.height_m: identified(run) for run in _identified(logs, (2,))}


def identified(run: Run) -> Identified:
    """Gain, delay and fit of a run's second-order model."""
    return Identified(run.fits[2].fit_percent, run.fits[2].point.gain, delay_s(run))


def _order_test(kind: str, runs: list[Run]) -> OrderTest:
    fits = {order: float(np.mean([run.fits[order].fit_percent for run in runs])) for order in ORDERS}
    unseen = {order: float(np.mean([_unseen_fit(*pair, order) for pair in _neighbours(runs)])) for order in ORDERS}
    return OrderTest(kind, runs[0].height_m, fits, unseen if len(runs) > 1 else {})


def _neighbours(runs: list[Run]) -> list[tuple[Run, Run]]:
    """Each run with the one it is validated on."""
    return list(zip(runs, [*runs[1:], runs[0]], strict=True))


def _unseen_fit(known: Run, unseen: Run, order: int) -> float:
    """Fit of a run's model on another run, whose start alone is estimated."""
    run, model = _experiment(unseen.log), known.fits[order]
    return fit_percent(run.y, simulate(run, model.structure, model.point))


# -- Tables 2 and 3 -------------------------------------------------------------------------------------------
def reading(dynamics: Dynamics, log: RigLog) -> Array:
    """The model's velocity [m/s] driven by the encoder, from rest; between samples the input is their mean."""
    u = log.reference_velocity_m_s
    held = 0.5 * (u[1:] + u[:-1])
    step = second_order_hold(dynamics.b_1_s, dynamics.c_1_s2, float(log.time_s[1] - log.time_s[0]))
    velocity, state = np.zeros(len(u)), (0.0, 0.0)
    for k, value in enumerate(held.tolist(), 1):
        state = hold_step(*state, value, step)
        velocity[k] = state[0]
    return dynamics.a_1_s2 * velocity


def error_of(dynamics: Dynamics, logs: Sequence[RigLog]) -> tuple[float, float]:
    """Mean and standard deviation of sensor less model over some logs [m/s]."""
    errors = np.concatenate([log.flow_velocity_m_s - reading(dynamics, log) for log in logs])
    return float(errors.mean()), float(errors.std())


def table_2(laboratory: Laboratory, dynamics: Callable[[Run, int], Dynamics]) -> list[ErrorRow]:
    """Each model on the next run of its height. dynamics: of a run and its number, ours or the published ones."""
    rows = []
    for height_m in HEIGHTS_M:
        for model, (run, unseen) in enumerate(_neighbours(laboratory.at(height_m)), 1):
            rows.append(ErrorRow(height_m, model, *error_of(dynamics(run, model), [unseen.log])))
    return rows


def table_3(laboratory: Laboratory, dynamics: Dynamics | None = None) -> list[ErrorRow]:
    """The selected model at every height, over the runs it does not come from; another model in its place if given."""
    height_0, model_0 = published.SELECTED_MODEL
    chosen = laboratory.at(height_0)[model_0 - 1]
    rows = []
    for height_m in HEIGHTS_M:
        logs = [run.log for run in laboratory.at(height_m) if run is not chosen]
        rows.append(ErrorRow(height_m, 0, *error_of(dynamics or chosen.dynamics, logs)))
    return rows


def delay_s(run: Run) -> float:
    """Low-frequency delay b/c of a run's second-order model."""
    return latency_s(run.fits[2].point)
