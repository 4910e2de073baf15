"""Normals for the sensors, by the noise counter: each sensor's own channels, into rows of the lane buffer."""

from __future__ import annotations

from flownav.compile import procedure
from flownav.estimation.kalman import Lanes, Work
from flownav.simulation.noise import normal_pair

# channels of the noise counter, pairs of normals; below 40 lie those of wind and of the paper's sensors
RECIRCULATION_CHANNEL = 36
INERTIAL_CHANNEL, RECEIVER_CHANNEL, CAMERA_CHANNEL, RANGE_CHANNEL = 40, 110, 120, 130
BARO_CHANNEL, MAG_CHANNEL, PAD_CHANNEL, SKID_CHANNEL = 136, 138, 142, 148
FAULT_CHANNEL = 150
(INERTIAL_START, RECEIVER_START, CAMERA_START, RANGE_START, BARO_START, MAG_START, PAD_START, SKID_START) = (
    160, 175, 183, 190, 192, 196, 205, 208,
)  # fmt: skip


@procedure
def draw(work: Work, lanes: Lanes, row: int, count: int, seed: int, flight: int, step: int, channel: int) -> None:
    """`count` (even) standard normals into rows from `row` on, of the channels from `channel` on."""
    for pair in range(count // 2):
        for lane in range(len(lanes)):
            first, second = normal_pair(seed, flight + lane, step, channel + pair)
            work[(row + 2 * pair) * len(lanes) + lane] = first
            work[(row + 2 * pair + 1) * len(lanes) + lane] = second
