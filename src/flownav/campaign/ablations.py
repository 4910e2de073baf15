"""The landing filter with one piece of its knowledge taken away, in flights that are otherwise the same.

What each piece is worth is what it costs to fly without it: the autopilot flies on the poorer estimate. There is no
variant without "ground-effect knowledge", since the filter has none to lose: the IMU measures the force that the
ground adds. Without the IMU the filter coasts, and the ground effect is one of the accelerations it does not see.
"""

from __future__ import annotations

import math

import numpy as np

from flownav.estimation.landing.settings import FlowLag
from flownav.estimation.landing.states import GPS_FAST, GPS_SLOW, GPS_VELOCITY
from flownav.sensors.flow import FlowParameters, flow_noise_sigma
from flownav.sensors.noise_law import constant_noise
from flownav.sensors.settings import NO_PAD_FIX
from flownav.simulation.assemble import Setup
from flownav.simulation.flight import Flight
from flownav.simulation.landing_filtering import LandingSetup
from flownav.simulation.sensing import EPOCH_S

# densities of what a coasting filter must allow for, of the order of what the autopilot commands in gusts: 0.5 m/s2
# and 0.1 rad/s with correlation times of 0.5 s and 0.1 s are sigma sqrt(2 tau)
COASTING_ACCEL_M_S2_RT_HZ = 0.5
COASTING_GYRO_RAD_S_RT_HZ = 0.05


def ablations(setup: Setup) -> dict[str, Flight]:
    """The variants that differ from the whole filter in this scenario, by what they lack.

    ValueError where another filter flies.
    """
    flight, landing = setup.flight, setup.flight.landing
    if landing is None:
        raise ValueError(f"{setup.scenario.name}: only the landing filter can be taken apart")
    b_1_s, c_1_s2 = setup.sensor.dynamics.b_1_s, setup.sensor.dynamics.c_1_s2
    variants = {
        "second-order dynamics": _with(flight, landing._replace(lag=first_order_lag(landing, b_1_s, c_1_s2))),
        "latency and dynamics": _with(flight, landing._replace(lag=no_lag(landing))),
        "height schedule": _with(flight, landing._replace(flow=constant_flow_noise(landing.flow))),
    }  # fmt: skip
    if setup.scenario.gps.model != "white":
        variants["GPS error states"] = _with(flight, without_gps_states(landing))
    variants["IMU"] = without_imu(flight, landing)
    if setup.scenario.pad_fix is not None:
        variants["pad fix"] = flight._replace(sensors=flight.sensors._replace(pad_fix=NO_PAD_FIX))
    variants["flow"] = _with(flight, landing._replace(fuse_flow=0.0))
    return variants


def _with(flight: Flight, landing: LandingSetup) -> Flight:
    return flight._replace(landing=landing)


def first_order_lag(landing: LandingSetup, b_1_s: float, c_1_s2: float) -> FlowLag:
    """The lag x' = -(c/b) x + m/b of the same gain a/c and the same delay b/c, over an epoch of straight m."""
    assert landing.lag is not None
    rate = c_1_s2 / b_1_s
    kept = math.exp(-rate * EPOCH_S)
    whole = (1.0 - kept) / rate
    end = (1.0 - whole / EPOCH_S) / rate
    return landing.lag._replace(
        f11=kept, f12=0.0, f21=0.0, f22=0.0, start_1=(whole - end) / b_1_s, start_2=0.0, end_1=end / b_1_s, end_2=0.0
    )


def no_lag(landing: LandingSetup) -> FlowLag:
    """A sensor of gain 1 that reports the velocity of now: what it saw at the end of the epoch and nothing before."""
    assert landing.lag is not None
    at_once = 1.0 / landing.lag.gain
    return landing.lag._replace(f11=0.0, f12=0.0, f21=0.0, f22=0.0, start_1=0.0, start_2=0.0, end_1=at_once, end_2=0.0)


def constant_flow_noise(flow: FlowParameters) -> FlowParameters:
    """The sensor's noise taken for the same at every height: its root mean square over the identified ones."""
    heights = np.linspace(flow.noise_low_m, flow.noise_high_m, 200)
    sigma = math.sqrt(float(np.mean([flow_noise_sigma(float(h), flow) ** 2 for h in heights])))
    noise = constant_noise(sigma, flow.noise_low_m, flow.noise_high_m)
    coefficients = {f"noise_{i}": value for i, value in enumerate(noise.coefficients)}
    return flow._replace(noise_centre=noise.centre, noise_scale=noise.scale, **coefficients)


def without_gps_states(landing: LandingSetup) -> LandingSetup:
    """No memory of GPS errors: all of their variance is taken for white noise."""
    settings = landing.settings
    level = settings.gps_slow_sigma_m**2 + settings.gps_fast_sigma_m**2
    down = settings.gps_slow_sigma_down_m**2 + settings.gps_fast_sigma_down_m**2
    start = landing.start_variance.copy()
    for state in (GPS_SLOW, GPS_FAST, GPS_VELOCITY):
        start[state : state + 3] = 0.0
    return landing._replace(
        settings=settings._replace(
            gps_slow_sigma_m=0.0, gps_slow_sigma_down_m=0.0, gps_fast_sigma_m=0.0, gps_fast_sigma_down_m=0.0,
            gps_velocity_sigma_m_s=0.0,
        ),
        start_variance=start,
        gps_position_variance=landing.gps_position_variance + np.array([level, level, down]),
        gps_velocity_variance=landing.gps_velocity_variance + settings.gps_velocity_sigma_m_s**2,
    )  # fmt: skip


def without_imu(flight: Flight, landing: LandingSetup) -> Flight:
    """An IMU so noisy that it tells no more than coasting would, and a filter that knows it; INS attitude stays."""
    settings, imu = landing.settings, flight.sensors.imu
    accel = COASTING_ACCEL_M_S2_RT_HZ / settings.accel_noise_m_s2_rt_hz
    gyro = COASTING_GYRO_RAD_S_RT_HZ / settings.gyro_noise_rad_s_rt_hz
    noisy = imu._replace(accel_sigma_m_s2=accel * imu.accel_sigma_m_s2, gyro_sigma_rad_s=gyro * imu.gyro_sigma_rad_s)
    coasting = settings._replace(
        accel_noise_m_s2_rt_hz=COASTING_ACCEL_M_S2_RT_HZ, gyro_noise_rad_s_rt_hz=COASTING_GYRO_RAD_S_RT_HZ
    )
    return flight._replace(sensors=flight.sensors._replace(imu=noisy), landing=landing._replace(settings=coasting))
