"""The navigator without one piece of what it knows or hears, in flights that are otherwise the same.

What each piece is worth is what it costs to fly without it: the autopilot flies on the poorer estimate. A piece of
knowledge goes by telling the navigator something else, a sensor by not carrying it; the code that flies is the same.
There is no variant without "ground-effect knowledge", since the navigator has none to lose: the IMU measures the force
that the ground adds. There is none without an IMU, either: nothing else tells the attitude.
"""

import math
from typing import Any

import numpy as np

from flownav.core.measurement import Sensor
from flownav.navigation.settings_of import Told
from flownav.navigation.told import FlowNoise
from flownav.sensors.flow import flow_noise_sigma
from flownav.sensors.noise_law import constant_noise
from flownav.simulation.assemble import Setup
from flownav.simulation.fitting import Fitted, Timing, refitted
from flownav.simulation.onboard import without
from flownav.simulation.plan import Flight


def ablations(setup: Setup) -> dict[str, Flight]:
    """The variants that differ from the whole navigator in this scenario, by what they lack.

    ValueError where the paper's filter flies.
    """
    carried = setup.fitted
    if carried is None:
        raise ValueError(f"{setup.scenario.name}: only the navigator can be taken apart")
    told = carried.told
    variants = {
        "flow's age": _with(setup, stated=carried.timing | {Sensor.FLOW_RATE: ageless(carried)}),
        "height schedule": _with(setup, told=told._replace(noise=constant_flow_noise(told.noise))),
        "compass deviation": _with(setup, told=without_compass_states(told)),
    }
    if setup.scenario.gps.model != "white":
        variants["GPS error states"] = _with(setup, told=without_gps_states(told))
    variants["barometer"] = _without(setup, "barometer")
    if setup.scenario.pad_fix is not None:
        variants["pad fix"] = _without(setup, "pad_camera")
    variants["flow"] = _without(setup, "flow_camera")
    return variants


def _with(setup: Setup, **changed: Any) -> Flight:
    """The flight with a navigator that is told, or a vehicle that carries, something else."""
    assert setup.fitted is not None
    other = refitted(setup.fitted, setup.flight.plan.epochs, **changed)
    return setup.flight._replace(onboard=other.onboard, table=other.schedule, settings=other.settings)


def _without(setup: Setup, sensor: str) -> Flight:
    """The flight of a vehicle that does not carry this sensor; the horizon stays."""
    assert setup.fitted is not None
    return _with(setup, onboard=without(setup.fitted.onboard, sensor))


def ageless(carried: Fitted) -> Timing:
    """A flow sensor that is said to show the velocity of now: no lag of its own, no latency; its jitter stays."""
    return Timing(0.0, 0.0, carried.timing[Sensor.FLOW_RATE].jitter_s)


def constant_flow_noise(noise: FlowNoise) -> FlowNoise:
    """The sensor's noise taken for the same at every height: its root mean square over the identified ones."""
    heights = np.linspace(noise.noise_low_m, noise.noise_high_m, 200)
    squares = [flow_noise_sigma(float(h), noise) ** 2 for h in heights]  # type: ignore[arg-type]  # the noise alone
    law = constant_noise(math.sqrt(float(np.mean(squares))), noise.noise_low_m, noise.noise_high_m)
    coefficients = {f"noise_{i}": value for i, value in enumerate(law.coefficients)}
    return noise._replace(noise_centre=law.centre, noise_scale=law.scale, **coefficients)


def without_gps_states(told: Told) -> Told:
    """No memory of GPS errors: all of their variance is taken for white noise."""
    s = told.settings
    return told._replace(
        settings=s.model_copy(
            update={
                "gps_slow_sigma_m": 0.0,
                "gps_slow_sigma_down_m": 0.0,
                "gps_fast_sigma_m": 0.0,
                "gps_fast_sigma_down_m": 0.0,
                "gps_velocity_sigma_m_s": 0.0,
                "gps_white_sigma_m": math.hypot(s.gps_white_sigma_m, s.gps_slow_sigma_m, s.gps_fast_sigma_m),
                "gps_white_sigma_down_m": math.hypot(
                    s.gps_white_sigma_down_m, s.gps_slow_sigma_down_m, s.gps_fast_sigma_down_m
                ),
                "gps_velocity_white_m_s": math.hypot(s.gps_velocity_white_m_s, s.gps_velocity_sigma_m_s),
                "gps_velocity_white_down_m_s": math.hypot(s.gps_velocity_white_down_m_s, s.gps_velocity_sigma_m_s),
            }
        )
    )


def without_compass_states(told: Told) -> Told:
    """No deviation that turns with the vehicle: all of it is taken for noise of the heading, as lasting as the rest."""
    s = told.settings
    noise = min(math.hypot(s.heading_noise_rad, s.compass_sigma_rad), math.pi)
    return told._replace(settings=s.model_copy(update={"compass_sigma_rad": 0.0, "heading_noise_rad": noise}))
