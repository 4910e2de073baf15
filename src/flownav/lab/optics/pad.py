"""Landing pads: patterns of reflectance 0..1 that repeat over the ground, as a raster of square texels.

Pads repeat without a seam, so blur can be applied to them exactly, by Fourier transform. Stripes are also
known in closed form (`Pad.stripe_pitch_m`), which `lab/rig/` renders from their harmonics.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError
from flownav.core.text import number

BLACK, WHITE = 0.167, 0.833  # grey 30 and 150 where white paper would be 180
STRIPE_GAP_M = 0.007  # the paper: "the best spacing between two black consecutive lines is 7 mm"
TEXEL_M = 0.25e-3
TEXTURE_TEXELS = 1024
LARGEST_PAD_TEXELS = 16_000_000


@dataclass(frozen=True)
class Pad:
    """A repeating pattern: `reflectance` (rows along y, columns along x) of texels `texel_m` wide."""

    name: str
    reflectance: NDArray[np.float32]
    texel_m: float
    stripe_pitch_m: float = 0.0  # above 0: stripes across x, a white one from x = 0 to half the pitch


def stripes(gap_m: float = STRIPE_GAP_M, name: str = "stripes") -> Pad:
    """Black lines across x, as wide as the white gaps between them: the paper's pad, pitch twice the gap."""
    if not 0.5e-3 <= gap_m <= 1.0:
        raise InputError(f"pad {name}: a gap of {gap_m * 1000:g} mm; it must be from 0.5 to 1000 mm")
    half = max(round(gap_m / TEXEL_M), 8)
    row = np.repeat(np.array([WHITE, BLACK], np.float32), half)
    return Pad(name, np.tile(row, (2 * half, 1)), gap_m / half, 2.0 * gap_m)


def texture(seed: int = 1, feature_m: float = 0.006, name: str = "texture") -> Pad:
    """A random pattern in two dimensions: blobs about `feature_m` wide, half black and half white."""
    rng = np.random.default_rng([seed, 1])
    noise = rng.standard_normal((TEXTURE_TEXELS, TEXTURE_TEXELS))
    smooth = _blurred(noise, feature_m / 4.0 / TEXEL_M)
    lit = 1.0 / (1.0 + np.exp(-4.0 * smooth / smooth.std()))
    return Pad(name, (BLACK + (WHITE - BLACK) * lit).astype(np.float32), TEXEL_M)


def checker(seed: int = 1, square_m: float = 0.016, name: str = "checker") -> Pad:
    """A chessboard with fine noise on it, so that the inside of a square is not blank."""
    side = round(square_m / TEXEL_M)
    squares = 2 * max(TEXTURE_TEXELS // (2 * side), 1)
    row, column = np.indices((squares * side, squares * side)) // side
    board = np.where((row + column) % 2 == 0, WHITE, BLACK)
    grain = _blurred(np.random.default_rng([seed, 2]).standard_normal(board.shape), 3.0)
    return Pad(name, np.clip(board + 0.05 * grain / grain.std(), 0.0, 1.0).astype(np.float32), TEXEL_M)


def from_image(path: Path, width_m: float) -> Pad:
    """A user's picture as a pad `width_m` wide, repeated. InputError where it cannot be read or is too large."""
    from flownav.lab.optics.frame_files import read_grey

    grey = read_grey(path)
    if min(grey.shape) < 2 or grey.size > LARGEST_PAD_TEXELS:
        raise InputError(
            f"{path}: {grey.shape[1]}x{grey.shape[0]} pixels; a pad has at least 2x2 and at most "
            f"{LARGEST_PAD_TEXELS // 1_000_000} million"
        )
    return Pad(path.name, (grey / np.float32(255.0)).astype(np.float32), width_m / grey.shape[1])


def pad_named(text: str, seed: int = 1) -> Pad:
    """`stripes` (7 mm gaps), `stripes-MM` (gaps of MM mm), `texture`, `checker`, or a picture `FILE:WIDTH_M`."""
    if text == "stripes":
        return stripes()
    if text.startswith("stripes-"):
        return stripes(_number(text, text.removeprefix("stripes-")) / 1000.0, text)
    if text in ("texture", "checker"):
        return texture(seed) if text == "texture" else checker(seed)
    path, separator, width = text.rpartition(":")
    if separator and path:
        width_m = _number(text, width)
        if not 0.005 <= width_m <= 100.0:
            raise InputError(f"pad {text}: a width of {width_m:g} m; it must be from 0.005 to 100 m")
        return from_image(Path(path), width_m)
    raise InputError(f"pad {text!r}: give stripes, stripes-MM, texture, checker, or a picture as FILE.png:WIDTH_M")


def _number(text: str, part: str) -> float:
    try:
        return number(part)
    except ValueError:
        raise InputError(f"pad {text}: {part!r} is not a number") from None


def _blurred(field: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
    """A repeating field under a Gaussian blur of `sigma` texels."""
    fy, fx = np.fft.fftfreq(field.shape[0])[:, None], np.fft.rfftfreq(field.shape[1])[None, :]
    transfer = np.exp(-2.0 * (np.pi * sigma) ** 2 * (fx**2 + fy**2))
    return np.asarray(np.fft.irfft2(np.fft.rfft2(field) * transfer, field.shape))
