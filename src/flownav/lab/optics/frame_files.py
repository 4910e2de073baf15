"""Pictures and videos from a user's disk as grey frames, uint8; cutting and binning them."""

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flownav.core.errors import InputError, arg
from flownav.core.files import natural_order
from flownav.core.guard import an_input, written_whole

PICTURES = {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm"}
VIDEOS = {".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v"}
LARGEST_FRAMES_BYTES = 4_000_000_000
MOST_PIXELS = 32_000_000  # of a picture; a file of some kilobytes can state any number


def read_frames(paths: Sequence[Path]) -> NDArray[np.uint8]:
    """Frames (n, height, width) of a folder of pictures (by name, 2 before 10), of pictures in order, or of one video.

    InputError where there are none, where one cannot be read, or where they differ in size.
    """
    if len(paths) == 1 and an_input(paths[0]).is_dir():
        found = sorted((f for f in paths[0].iterdir() if f.suffix.lower() in PICTURES), key=natural_order)
        if not found:
            raise InputError(f"{paths[0]}: no pictures in it ({', '.join(sorted(PICTURES))})")
        return _stacked(found)
    if len(paths) == 1 and paths[0].suffix.lower() in VIDEOS:
        return _video(paths[0])
    return _stacked(list(paths))


def read_grey(path: Path) -> NDArray[np.uint8]:
    """One picture as grey levels (height, width); colours by their luminance. InputError names the file."""
    image_of, path = pillow(), an_input(path)
    try:
        with image_of.open(path) as picture:
            width, height = picture.size
            if width * height > MOST_PIXELS:
                raise InputError(
                    f"{path}: {width}x{height} pixels; at most {MOST_PIXELS:,} are read, so make it smaller"
                )
            mode = "I" if picture.mode.startswith("I") else "L"
            grey = np.asarray(picture.convert(mode))
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except InputError:
        raise
    except Exception as error:  # pillow raises many kinds on a broken file
        raise InputError(f"{path}: not a picture that can be read ({type(error).__name__}: {error})") from None
    return (grey >> 8).astype(np.uint8) if mode == "I" and grey.size and grey.max() > 255 else grey.astype(np.uint8)


def _stacked(files: list[Path]) -> NDArray[np.uint8]:
    first = read_grey(files[0])
    if first.size * len(files) > LARGEST_FRAMES_BYTES:
        raise InputError(f"{files[0]}: {len(files)} frames of this size do not fit in memory; give fewer at a time")
    frames = np.empty((len(files), *first.shape), np.uint8)
    for k, file in enumerate(files):
        frame = first if k == 0 else read_grey(file)
        if frame.shape != first.shape:
            size, expected = f"{frame.shape[1]}x{frame.shape[0]}", f"{first.shape[1]}x{first.shape[0]}"
            raise InputError(f"{file}: {size} pixels where {files[0].name} has {expected}; frames must be of one size")
        frames[k] = frame
    return frames


def pillow() -> Any:
    """Pillow's pictures. InputError where the package is not installed."""
    try:
        from PIL import Image
    except ImportError:
        raise InputError("pictures need Pillow: pip install 'flownav[pictures]'") from None
    return Image


def _video(path: Path) -> NDArray[np.uint8]:
    try:
        av: Any = import_module("av")
    except ImportError:
        raise InputError(
            f"{path}: reading video needs PyAV: pip install 'flownav[video]'; "
            f"or extract the frames, ffmpeg -i {path.name} frames/%06d.png, and give the folder"
        ) from None
    try:
        with av.open(str(an_input(path))) as container:
            frames: list[NDArray[np.uint8]] = []
            for frame in container.decode(video=0):
                if frame.width * frame.height * (len(frames) + 1) > LARGEST_FRAMES_BYTES:
                    raise InputError(f"{path}: its frames do not fit in memory; cut it into pieces, or make it smaller")
                frames.append(frame.to_ndarray(format="gray"))
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, ValueError, IndexError) as error:  # av's own errors derive from these
        raise InputError(f"{path}: not a video that can be read ({error})") from None
    if not frames:
        raise InputError(f"{path}: no frames in it")
    return np.stack(frames)


def signature() -> Any:
    """Text entry of a PNG that names its writer."""
    from PIL.PngImagePlugin import PngInfo

    text = PngInfo()
    text.add_text("Software", "flownav")
    return text


def save_picture(frame: NDArray[np.uint8], path: Path) -> None:
    """Write a frame (height, width) as a PNG. InputError where it cannot be written."""
    image = pillow()
    try:
        with written_whole(path) as temporary:
            image.fromarray(frame).save(temporary, format="PNG", pnginfo=signature())
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); give another folder") from error


# -- cutting and binning -----------------------------------------------------------------------------------------
def binned(frames: NDArray[np.uint8], factor: int) -> NDArray[np.uint8]:
    """Frames (n, height, width) with `factor` x `factor` pixels averaged into one; what is left over is cut off."""
    if factor == 1:
        return frames
    n, height, width = frames.shape
    rows, columns = height // factor, width // factor
    if min(rows, columns) < 1:
        raise InputError(
            f"frames of {width}x{height} pixels cannot be binned by {factor}; give a smaller {arg('factor')}"
        )
    blocks = frames[:, : rows * factor, : columns * factor].reshape(n, rows, factor, columns, factor)
    return np.asarray(np.round(blocks.mean(axis=(2, 4))), np.uint8)


def middle(frames: NDArray[np.uint8], size_px: int) -> NDArray[np.uint8]:
    """The middle `size_px` x `size_px` pixels of every frame. InputError where frames are smaller."""
    height, width = frames.shape[1:]
    if not 1 <= size_px <= min(height, width):
        raise InputError(f"a window of {size_px} px does not fit in frames of {width}x{height} px; give a smaller one")
    top, left = (height - size_px) // 2, (width - size_px) // 2
    return np.ascontiguousarray(frames[:, top : top + size_px, left : left + size_px])
