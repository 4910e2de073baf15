"""Landing pads that repeat over the ground, and targets: coded squares, or plain pads known by their outline.

Pads repeat without a seam, so blur can be applied to them exactly, by Fourier transform. Stripes are also
known in closed form (`Pad.stripe_pitch_m`), which `lab/rig/` renders from their harmonics.

Both are boards of 10x10 cells. A tag is an AprilTag of the family 36h11 (Olson 2011; the barcodes are free to use):
a white ring, a black ring, and 6x6 cells of code. A plain pad is 8x8 squares or 8 stripes within a white ring.
A nested tag has a smaller one, a fifth as large and of the code before its own, in the place of its middle 2x2 cells,
for when the outer no longer fits the frame.
Board axes: x towards the top of the printed picture, y to its right, z down; the origin is the board's centre.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError
from flownav.core.guard import written_whole
from flownav.core.text import number
from flownav.lab.optics.frame_files import pillow, signature

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


# -- targets -----------------------------------------------------------------------------------------------------
# codes 0 to 15 of the family 36h11, row by row from the top left, 1 is white; any two differ in 11 cells or more
CODES_36H11 = (
    *(0xD5D628584, 0xD97F18B49, 0xDD280910E, 0xE479E9C98, 0xEBCBCA822, 0xF31DAB3AC, 0x056A5D085, 0x10652E1D4),
    *(0x22B1DFEAD, 0x265AD0472, 0x34FE91B86, 0x3FF962CD5, 0x43A25329A, 0x474B4385F, 0x4E9D243E9, 0x5246149AE),
)
CODE_CELLS, TAG_CELLS, BOARD_CELLS = 6, 8, 10
PATTERNS = ("tag", "nested", "checker", "stripes")
NESTED_CELLS = 5  # of the inner board in a cell of the outer, whose middle two by two cells it takes
GROUND_REFLECTANCE, GROUND_SPREAD = 0.35, 0.08
RASTER_BLOCK = 64  # rasters are a multiple of this many texels wide, which Fourier transforms like
LARGEST_RASTER_TEXELS = 8192


class PadTarget(NamedTuple):
    """The target on the ground: `side_m` is that of the black square of a tag, or of a plain pad's outline.

    Of a nested tag `side_m` is the outer's, and `code` the inner's; the outer's is the next.
    """

    side_m: float = 0.2
    pattern: str = "tag"
    code: int = 0

    @property
    def coded(self) -> bool:
        """Whether the target shows its identity and its heading."""
        return self.pattern in ("tag", "nested")

    @property
    def inner(self) -> PadTarget:
        """The tag in the middle of a nested one; any other target is its own."""
        nested = self.pattern == "nested"
        return PadTarget(self.side_m / NESTED_CELLS, "tag", self.code) if nested else self

    @property
    def board_m(self) -> float:
        """Side of the board with its white ring [m]."""
        return BOARD_CELLS * self.cell_m

    @property
    def cell_m(self) -> float:
        """Side of one cell [m]."""
        return self.side_m / (TAG_CELLS if self.coded else BOARD_CELLS)


def checked(target: PadTarget) -> PadTarget:
    """The target itself; InputError where there is none like it."""
    if target.pattern not in PATTERNS:
        raise InputError(f"target {target.pattern!r}: unknown; known are {', '.join(PATTERNS)}")
    if not 0.01 <= target.side_m <= 20.0:
        raise InputError(f"target: a side of {target.side_m:g} m; it must be from 0.01 to 20 m")
    last = len(CODES_36H11) - (2 if target.pattern == "nested" else 1)
    if not 0 <= target.code <= last:
        raise InputError(f"target: code {target.code}; it must be from 0 to {last}")
    return target


def code_cells(code: int) -> NDArray[np.bool_]:
    """The 6x6 cells of a code as printed, True where white."""
    word = CODES_36H11[code]
    bits = [word >> (CODE_CELLS**2 - 1 - k) & 1 for k in range(CODE_CELLS**2)]
    return np.array(bits, bool).reshape(CODE_CELLS, CODE_CELLS)


def picture_cells(target: PadTarget) -> NDArray[np.bool_]:
    """The 10x10 cells of the printed board, True where white; of a nested tag the outer's.

    InputError where the target is unknown.
    """
    cells = np.ones((BOARD_CELLS, BOARD_CELLS), bool)
    row, column = np.indices((TAG_CELLS, TAG_CELLS))
    if checked(target).coded:
        cells[1:-1, 1:-1] = np.pad(code_cells(target.code + (target.pattern == "nested")), 1)
    else:
        cells[1:-1, 1:-1] = (row + column if target.pattern == "checker" else column) % 2 == 1
    return cells


def printed_cells(target: PadTarget) -> NDArray[np.bool_]:
    """The cells of the whole picture, 10x10, or 50x50 of a nested tag."""
    cells = picture_cells(target)
    if target.pattern != "nested":
        return cells
    fine = np.repeat(np.repeat(cells, NESTED_CELLS, 0), NESTED_CELLS, 1)
    middle = slice((len(fine) - BOARD_CELLS) // 2, (len(fine) + BOARD_CELLS) // 2)
    fine[middle, middle] = picture_cells(target.inner)
    return fine


def corners_m(target: PadTarget) -> NDArray[np.float64]:
    """Corners (4, 2) of the square that is looked for [m], clockwise from above, from the picture's top left."""
    return 0.5 * target.side_m * np.array([[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]])


def laid_out(target: PadTarget, extent_m: float, finest_texel_m: float, seed: int = 1) -> Pad:
    """The board, centred on the origin, on ground that repeats after `extent_m` or a little more.

    Texels are `finest_texel_m` wide or less, whole parts of a cell, so that edges lie exactly where the target has
    them. InputError where the raster would be too large.
    """
    cells = printed_cells(target)
    cell_m = target.board_m / len(cells)
    per_cell = max(int(np.ceil(cell_m / finest_texel_m)), 1)
    texel_m = cell_m / per_cell
    board = np.where(np.repeat(np.repeat(cells, per_cell, 0), per_cell, 1), WHITE, BLACK)[::-1].T  # rows y, columns x
    wanted = max(extent_m / texel_m, len(board) + 1.0)
    size = int(np.ceil(wanted / RASTER_BLOCK)) * RASTER_BLOCK
    if size > LARGEST_RASTER_TEXELS:
        raise InputError(
            f"target of {target.side_m:g} m: seen over {extent_m:.3g} m it needs {size} texels a side, more than "
            f"{LARGEST_RASTER_TEXELS}; give a larger target or a lower height"
        )
    reflectance = ground(size, seed)
    reflectance[: len(board), : len(board)] = board
    half = len(board) // 2
    return Pad(target.pattern, np.roll(reflectance, (-half, -half), (0, 1)), texel_m)


def ground(size: int, seed: int = 1) -> NDArray[np.float32]:
    """Reflectance of natural ground, a repeating square raster: as much contrast in every octave of scale.

    The amplitude falls as 1/frequency, as it does in natural scenes (Field 1987).
    """
    white = np.random.default_rng([seed, 5]).standard_normal((size, size), dtype=np.float32)
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :])
    frequency[0, 0] = np.inf
    field = np.fft.irfft2(np.fft.rfft2(white) / frequency, white.shape)
    level = np.clip(GROUND_REFLECTANCE + GROUND_SPREAD * field / field.std(), 0.02, 0.98)
    return np.asarray(level, np.float32)


def print_target(target: PadTarget, path: Path, dots_per_inch: int = 300) -> None:
    """Write the board as a picture that prints at its true size. InputError where it cannot be written."""
    image = pillow()
    cells = printed_cells(target)
    cell_m = target.board_m / len(cells)
    dots = max(round(cell_m / 0.0254 * dots_per_inch), 1)
    printed_per_inch = dots * 0.0254 / cell_m  # so that a whole number of dots a cell keeps the size
    if dots * len(cells) > LARGEST_RASTER_TEXELS * 4:
        raise InputError(f"target of {target.side_m:g} m: too large a picture; print it in parts or smaller")
    picture = np.where(np.repeat(np.repeat(cells, dots, 0), dots, 1), 255, 0).astype(np.uint8)
    try:
        with written_whole(path) as temporary:
            resolution = (printed_per_inch, printed_per_inch)
            image.fromarray(picture).save(temporary, format="PNG", dpi=resolution, pnginfo=signature())
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); give another place") from error
