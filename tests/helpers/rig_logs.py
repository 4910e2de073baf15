"""Small rig logs: one CSV file of a swing whose gain and delay are known."""

from __future__ import annotations

import numpy as np


def write_csv(path, t_s, reference, flow):
    rows = [f"{t:.4f},{u:.6f},{y:.6f}" for t, u, y in zip(t_s, reference, flow, strict=True)]
    path.write_text("\n".join(["t_s,reference_velocity_m_s,flow_velocity_m_s", *rows]) + "\n", encoding="utf-8")
    return path


def swing(path, duration_s=12.0, gain=0.9, delay_s=0.08, noise=0.02):
    """A swing of two tones and a sensor of known gain and delay."""
    t_s = np.arange(0.0, duration_s, 0.01)

    def velocity(t):
        return 0.3 * np.sin(2.6 * t) + 0.1 * np.sin(7.0 * t)

    flow = gain * velocity(t_s - delay_s) + noise * np.random.default_rng(1).standard_normal(len(t_s))
    return write_csv(path, t_s, velocity(t_s), flow)
