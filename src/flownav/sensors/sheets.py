"""The datasheets of IMU and GPS receiver with the coefficients that follow from them, and those of all that is carried.

Simulation draws from them, and the navigator's settings follow from them.
"""

import math
from typing import ClassVar

from pydantic import Field

from flownav.core.frames import GRAVITY_M_S2
from flownav.core.parameter_files import Number, ParameterModel, in_si, record_of
from flownav.sensors.barometer import BarometerSheet
from flownav.sensors.camera_sheets import FlowCameraSheet, PadCameraSheet
from flownav.sensors.datasheet import FlowSensor, load_sensor
from flownav.sensors.gps_receiver import GpsReceiverParameters
from flownav.sensors.inertial import InertialParameters
from flownav.sensors.magnetometer import MagneticField, MagnetometerSheet
from flownav.sensors.processes import gauss_markov_coefficients, lag_weights, steps_per_unit
from flownav.sensors.range_sensor import RangeSensorSheet
from flownav.sensors.sheet import Lever, SensorSheet, Spells
from flownav.sensors.skid_switch import SkidSwitchSheet


class GyroSheet(ParameterModel):
    """density: one-sided; bias: at the start, one standard deviation; scale, misalignment, g-sensitivity: the same."""

    density_deg_s_rthz: Number = Field(ge=0.0, le=100.0)  # white noise, one-sided density
    bias_deg_s: Number = Field(ge=0.0, le=100.0)  # at the start of a flight, standard deviation
    walk_deg_s_rts: Number = Field(ge=0.0, le=100.0)  # random walk of the bias
    scale_percent: Number = Field(ge=0.0, le=20.0)  # error of an axis's scale, standard deviation
    misalignment_deg: Number = Field(ge=0.0, le=5.0)  # of each axis towards each other one, standard deviation
    g_sensitivity_deg_s_g: Number = Field(ge=0.0, le=10.0)  # rate read per acceleration, standard deviation
    range_deg_s: Number = Field(gt=0.0, le=1e4)  # readings stop at this, either way


class AccelerometerSheet(ParameterModel):
    """An accelerometer, with the gyro's keys; densities and biases in parts of standard gravity."""

    density_ug_rthz: Number = Field(ge=0.0, le=1e5)  # white noise, one-sided density
    bias_mg: Number = Field(ge=0.0, le=1000.0)  # at the start of a flight, standard deviation
    walk_mg_rts: Number = Field(ge=0.0, le=1000.0)  # random walk of the bias
    scale_percent: Number = Field(ge=0.0, le=20.0)  # error of an axis's scale, standard deviation
    misalignment_deg: Number = Field(ge=0.0, le=5.0)  # of each axis towards each other one, standard deviation
    range_g: Number = Field(gt=0.0, le=1000.0)  # readings stop at this, either way


class Tone(ParameterModel):
    """Amplitudes at one frequency, where the unit is fixed: along body x and y, along z, about x and y, about z."""

    level_m_s2: Number = Field(0.0, ge=0.0, le=200.0)  # amplitude along body x and y, a quarter turn apart
    vertical_m_s2: Number = Field(0.0, ge=0.0, le=200.0)  # amplitude along body z
    tilt_deg_s: Number = Field(0.0, ge=0.0, le=500.0)  # amplitude of roll and pitch rate, a quarter turn apart
    yaw_deg_s: Number = Field(0.0, ge=0.0, le=500.0)  # amplitude of the yaw rate


class Vibration(ParameterModel):
    """Tones at the rotor's and at the blades' frequency; the spreads are shares by which flights differ."""

    spread: Number = Field(0.0, ge=0.0, le=2.0)  # share by which flights differ in all amplitudes; 0: alike
    speed_spread: Number = Field(0.0, ge=0.0, le=0.1)  # share by which rotors differ from their stated speed
    rotor: Tone = Tone()
    blades: Tone = Tone()


class InertialSheet(SensorSheet):
    """An IMU. `bandwidth_hz`: of the filter ahead of the mean over the period (-3 dB, first order)."""

    shipped_file: ClassVar[str] = "inertial.toml"

    rate_hz: Number = Field(ge=100.0, le=1000.0)  # readings a second, each the mean since the last
    bandwidth_hz: Number = Field(gt=0.0, le=1e5)  # of the low-pass ahead of that mean: first order, -3 dB
    gyro: GyroSheet
    accelerometer: AccelerometerSheet
    vibration: Vibration = Vibration()

    def left_of_tone(self, frequency_hz: float) -> float:
        """Amplitude in the readings over amplitude where the unit is fixed: bandwidth, and the mean over a period."""
        turn = math.pi * frequency_hz * self.period_s
        mean = math.sin(turn) / turn if turn > 0.0 else 1.0
        return mean / math.hypot(1.0, frequency_hz / self.bandwidth_hz)

    def parameters(self, rotor_speed_rad_s: float, blade_count: float) -> InertialParameters:
        """Coefficients of one period on a vehicle with this rotor (of a multirotor: one of its propellers)."""
        rt_period, per_reading = math.sqrt(self.period_s), math.sqrt(0.5 * self.rate_hz)
        mg, accel = 1e-3 * GRAVITY_M_S2, self.accelerometer
        gyro = in_si(self.gyro, "gyro_")
        tones = self._tone("rev", rotor_speed_rad_s) | self._tone("blade", rotor_speed_rad_s * blade_count)
        return record_of(
            InertialParameters,
            in_si(self) | in_si(accel, "accel_") | tones,
            gyro_sigma_rad_s=gyro["gyro_density_rad_s_rthz"] * per_reading,
            gyro_walk_rad_s=gyro["gyro_walk_rad_s_rts"] * rt_period,
            gyro_per_force_rad_s=gyro["gyro_g_sensitivity_rad_s_g"] / GRAVITY_M_S2,
            accel_sigma_m_s2=1e-3 * mg * accel.density_ug_rthz * per_reading,
            accel_bias_m_s2=mg * accel.bias_mg,
            accel_walk_m_s2=mg * accel.walk_mg_rts * rt_period,
            accel_range_m_s2=GRAVITY_M_S2 * accel.range_g,
        )

    def _tone(self, name: str, speed_rad_s: float) -> dict[str, float]:
        """A tone's turn in a period, and the remaining share of its amplitudes, as parameters by name."""
        tone = self.vibration.rotor if name == "rev" else self.vibration.blades
        left, turn = self.left_of_tone(speed_rad_s / (2.0 * math.pi)), speed_rad_s * self.period_s
        amplitudes = {key: left * amplitude for key, amplitude in in_si(tone, f"{name}_").items()}
        phase = {f"{name}_cosine": math.cos(turn), f"{name}_sine": math.sin(turn), f"{name}_turn_rad": turn}
        return phase | amplitudes


class PositionErrors(ParameterModel):
    """Slow, fast and white error of an axis; `spread`: the share by which flights differ in all of them."""

    slow_sigma_m: Number = Field(ge=0.0, le=100.0)  # ionosphere and orbits: standard deviation, north and east
    slow_sigma_down_m: Number = Field(ge=0.0, le=100.0)  # the same, down
    slow_tau_s: Number = Field(ge=0.0, le=1e5)  # its correlation time; 0: white
    fast_sigma_m: Number = Field(ge=0.0, le=100.0)  # multipath: standard deviation, north and east
    fast_sigma_down_m: Number = Field(ge=0.0, le=100.0)  # the same, down
    fast_tau_s: Number = Field(ge=0.0, le=1e5)  # its correlation time; 0: white
    white_sigma_m: Number = Field(ge=0.0, le=100.0)  # noise of a fix: standard deviation, north and east
    white_sigma_down_m: Number = Field(ge=0.0, le=100.0)  # the same, down
    quantum_m: Number = Field(0.0, ge=0.0, le=1.0)  # positions come in whole steps of this; 0: no steps
    spread: Number = Field(0.0, ge=0.0, le=2.0)  # share by which flights differ in all of them; 0: alike


class VelocityErrors(ParameterModel):
    """Correlated and white error of an axis, and the time constant of the receiver's own smoothing."""

    sigma_m_s: Number = Field(ge=0.0, le=10.0)  # lasting error: standard deviation, north and east
    sigma_down_m_s: Number = Field(ge=0.0, le=10.0)  # the same, down
    tau_s: Number = Field(ge=0.0, le=1e5)  # its correlation time; 0: white
    white_m_s: Number = Field(ge=0.0, le=10.0)  # noise of a fix: standard deviation, north and east
    white_down_m_s: Number = Field(ge=0.0, le=10.0)  # the same, down
    smoothing_tau_s: Number = Field(0.0, ge=0.0, le=2.0)  # lag of the receiver's own smoothing; 0: none
    quantum_m_s: Number = Field(0.0, ge=0.0, le=1.0)  # velocities come in whole steps of this; 0: no steps


class GpsReceiverSheet(SensorSheet):
    """A receiver. `stated_spread`: the share by which the accuracies that it states are wrong."""

    shipped_file: ClassVar[str] = "gps_receiver.toml"

    rate_hz: Number = Field(ge=0.2, le=50.0)  # fixes a second
    position: PositionErrors
    velocity: VelocityErrors
    stated_spread: Number = Field(0.0, ge=0.0, le=2.0)  # share by which the accuracies that it states are wrong
    outage: Spells = Spells()
    antenna: Lever = Lever()

    @property
    def horizontal_sigma_m(self) -> float:
        """Standard deviation of a horizontal axis, all position errors together."""
        e = self.position
        return math.hypot(e.slow_sigma_m, e.fast_sigma_m, e.white_sigma_m)

    @property
    def vertical_sigma_m(self) -> float:
        """Standard deviation of the vertical position."""
        e = self.position
        return math.hypot(e.slow_sigma_down_m, e.fast_sigma_down_m, e.white_sigma_down_m)

    @property
    def speed_sigma_m_s(self) -> float:
        """Standard deviation of a horizontal velocity, its lag apart."""
        return math.hypot(self.velocity.sigma_m_s, self.velocity.white_m_s)

    def parameters(self) -> GpsReceiverParameters:
        """Coefficients of one period."""
        e, v, period = self.position, self.velocity, self.period_s
        return GpsReceiverParameters(
            self.antenna.forward_m, self.antenna.right_m, self.antenna.down_m,
            *gauss_markov_coefficients(e.slow_tau_s, period), e.slow_sigma_m, e.slow_sigma_down_m,
            *gauss_markov_coefficients(e.fast_tau_s, period), e.fast_sigma_m, e.fast_sigma_down_m,
            e.white_sigma_m, e.white_sigma_down_m,
            *gauss_markov_coefficients(v.tau_s, period), v.sigma_m_s, v.sigma_down_m_s, v.white_m_s, v.white_down_m_s,
            *lag_weights(v.smoothing_tau_s, period),
            e.quantum_m, steps_per_unit(e.quantum_m), v.quantum_m_s, steps_per_unit(v.quantum_m_s),
            self.horizontal_sigma_m, self.vertical_sigma_m, self.speed_sigma_m_s,
            self.stated_spread, e.spread, *self.outage.levels(period),
        )  # fmt: skip


class SensorSheets(ParameterModel):
    """One sheet of each sensor; None where the vehicle has none. Only the IMU must be there.

    flow_sensor: the sensor file (dynamics, noise, limits) that the flow camera goes with.
    magnetic_field: the place's.
    """

    inertial: InertialSheet
    magnetometer: MagnetometerSheet | None = None
    magnetic_field: MagneticField = MagneticField()
    barometer: BarometerSheet | None = None
    gps_receiver: GpsReceiverSheet | None = None
    flow_camera: FlowCameraSheet | None = None
    flow_sensor: FlowSensor | None = None
    range_sensor: RangeSensorSheet | None = None
    pad_camera: PadCameraSheet | None = None
    skid_switch: SkidSwitchSheet | None = None


def shipped_sheets() -> SensorSheets:
    """The sheets that ship with flownav: a small helicopter with everything on board."""
    return SensorSheets(
        inertial=InertialSheet.read(),
        magnetometer=MagnetometerSheet.read(),
        barometer=BarometerSheet.read(),
        gps_receiver=GpsReceiverSheet.read(),
        flow_camera=FlowCameraSheet.read(),
        flow_sensor=load_sensor(),
        range_sensor=RangeSensorSheet.read(),
        pad_camera=PadCameraSheet.read(),
        skid_switch=SkidSwitchSheet.read(),
    )
