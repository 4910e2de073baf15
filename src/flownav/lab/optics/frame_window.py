"""Cutting and binning frames before they are matched."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError


def binned(frames: NDArray[np.uint8], factor: int) -> NDArray[np.uint8]:
    """Frames (n, height, width) with `factor` x `factor` pixels averaged into one; what is left over is cut off."""
    if factor == 1:
        return frames
    n, height, width = frames.shape
    rows, columns = height // factor, width // factor
    if min(rows, columns) < 1:
        raise InputError(f"frames of {width}x{height} pixels cannot be binned by {factor}; give a smaller --bin")
    blocks = frames[:, : rows * factor, : columns * factor].reshape(n, rows, factor, columns, factor)
    return np.asarray(np.round(blocks.mean(axis=(2, 4))), np.uint8)


def middle(frames: NDArray[np.uint8], size_px: int) -> NDArray[np.uint8]:
    """The middle `size_px` x `size_px` pixels of every frame. InputError where frames are smaller."""
    height, width = frames.shape[1:]
    if not 1 <= size_px <= min(height, width):
        raise InputError(f"a window of {size_px} px does not fit in frames of {width}x{height} px; give a smaller one")
    top, left = (height - size_px) // 2, (width - size_px) // 2
    return np.ascontiguousarray(frames[:, top : top + size_px, left : left + size_px])
