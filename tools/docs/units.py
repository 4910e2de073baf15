"""The unit that a name states in its last parts: `horizontal_m`, `rate_rad_s`, `gyro_noise_rad_s_rt_hz`."""

from __future__ import annotations

UNITS = {
    "1_rad": "1/rad", "1_s": "1/s", "1_s2": "1/s²", "a": "A", "ah": "Ah", "deg": "°", "deg_s": "°/s",
    "deg_s_g": "°/s/g",
    "deg_s_rt_hz": "°/s/√Hz", "deg_s_rthz": "°/s/√Hz", "deg_s_rts": "°/s/√s", "20ft_m_s": "m/s", "g": "g",
    "gauss": "G", "hz": "Hz", "kg": "kg", "kg_m2": "kg·m²", "kg_m3": "kg/m³", "m": "m", "m2": "m²", "m2_s2": "m²/s²",
    "m_per_h": "m/h", "m_rt_s": "m/√s", "m_s": "m/s", "m_s2": "m/s²", "m_s2_rt_hz": "m/s²/√Hz",
    "m_s2_rt_s": "m/s²/√s", "mg": "mg", "mg_rts": "mg/√s", "mgauss": "mG", "mgauss_per_kw": "mG/kW", "mrad": "mrad",
    "n": "N", "n_m": "N/m", "n_m_rad": "N·m/rad", "n_s_m": "N·s/m", "n_s2_m_rad": "N·s²·m/rad", "ohm": "Ω",
    "per_m_mrad": "mrad/m", "per_m_percent": "%/m", "per_rad": "1/rad", "per_rad_s_mrad": "mrad/(rad/s)",
    "per_rad_s_percent": "%/(rad/s)", "per_rt_s": "1/√s", "percent": "%", "px": "px", "rad": "rad", "rad_s": "rad/s",
    "rad_s_rt_hz": "rad/s/√Hz", "rad_s_rt_s": "rad/s/√s", "s": "s", "s_rad": "s/rad", "ug_rthz": "µg/√Hz", "v": "V",
    "w": "W",
}  # fmt: skip
AXES = ("n", "e", "d", "u", "v", "w", "x", "y", "z")  # before a unit these are directions: pos_n_m is in metres
QUANTITIES = ("pos", "vel", "slow", "fast", "velocity", "ground", "pad", "tilt", "bias", "rate", "gyro", "accel", "mag")


def unit_of(name: str) -> str:
    """The unit of a key or column; "" where its name states none.

    The longest run of last parts that is a unit counts, unless it begins with a direction: `vel_n_m_s` is in m/s.
    """
    parts = name.split("_")
    for first in range(len(parts)):
        if parts[first] in AXES and first and parts[first - 1] in QUANTITIES:
            continue
        unit = UNITS.get("_".join(parts[first:]))
        if unit is not None and (first or len(parts) > 1):
            return unit
    return ""
