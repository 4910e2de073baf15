"""Block matching beside OpenCV's pyramidal Lucas-Kanade: the same frames, the same points, one thread each.

Run with `python -m pytest benchmarks/test_bench_optics.py --benchmark-only`. Each case reports, beside its time,
frames per second of CPU and its error against the analytic flow (`extra_info`, shown with `--benchmark-json`
and printed with `-s`).
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from flownav.lab.optics.block_matching import TILE, corners
from flownav.lab.optics.camera import Camera, effective_focal_px
from flownav.lab.optics.firmware import VERSIONS
from flownav.lab.optics.flow import raw_flow
from flownav.lab.optics.pad import texture
from flownav.lab.optics.projection import pose_looking_down
from flownav.lab.optics.render import film
from optical_oracles import CameraMotion, motion_field

HEIGHT_M, FPS, FRAMES = 0.8, 250.0, 1000
ASKED_FPS = 5000.0


@pytest.fixture(scope="module")
def scene() -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Frames over a textured pad at speeds that sweep -3 ... 3 px a frame in x, and the analytic flow (n-1, 2)."""
    camera = Camera(focus_m=HEIGHT_M)
    focal_px = effective_focal_px(camera)
    speed = 0.85 * np.sin(2.0 * np.pi * np.arange(FRAMES - 1) / 400.0)
    place = np.concatenate([[0.0], np.cumsum(speed / FPS)])
    poses = [pose_looking_down(x, 0.3 * x, HEIGHT_M) for x in place]
    motions = [CameraMotion(v, 0.3 * v, 0.0, 0.0, 0.0, 0.0) for v in speed]
    flow = np.array([motion_field(m, HEIGHT_M, 0.0, 0.0, focal_px) for m in motions]) / FPS
    return film(texture(5), poses, camera=camera), flow


def report(benchmark, name: str, work: Callable[[], NDArray[np.float64]], truth: NDArray[np.float64]) -> float:  # type: ignore[no-untyped-def]
    """Time the work; note frames per CPU second and error; returns the former."""
    found = work()  # compiles
    rates = []
    for _ in range(1 if benchmark.disabled else 3):
        start = time.process_time()
        work()
        rates.append(len(truth) / (time.process_time() - start))
    benchmark.pedantic(work, rounds=3, iterations=1)
    error = found - truth
    facts = {
        "frames_per_cpu_s": round(max(rates)),
        "rms_error_px": round(float(np.sqrt(np.mean(error**2))), 4),
        "mean_error_px": round(float(error.mean()), 4),
        "largest_error_px": round(float(np.abs(error).max()), 3),
    }
    benchmark.extra_info.update(facts)
    print(f"\n{name}: {facts}")
    return max(rates)


@pytest.mark.benchmark(group="flow of 64x64 frames")
@pytest.mark.parametrize("version", ["2013-09", "2014-12", "2016"])
def test_block_matching(benchmark, scene, version: str) -> None:  # type: ignore[no-untyped-def]
    frames, truth = scene
    firmware = VERSIONS[version]._replace(half_pixel_y_defect=False)
    rate = report(benchmark, f"block matching {version}", lambda: raw_flow(frames, firmware)[0], truth)
    assert benchmark.disabled or rate >= ASKED_FPS


@pytest.mark.benchmark(group="flow of 64x64 frames")
@pytest.mark.parametrize("version", ["2013-09", "2014-12"])
def test_opencv_lucas_kanade(benchmark, scene, version: str) -> None:  # type: ignore[no-untyped-def]
    """Mean of the tracked points, one in the middle of every patch of the firmware's grid."""
    cv2 = pytest.importorskip("cv2", reason="pip install opencv-python-headless")
    cv2.setNumThreads(1)
    frames, truth = scene
    middle = corners(64, VERSIONS[version]).astype(np.float32) + 0.5 * (TILE - 1)
    points = np.stack(np.meshgrid(middle, middle), axis=-1).reshape(-1, 1, 2).astype(np.float32)

    def track() -> NDArray[np.float64]:
        flow = np.zeros_like(truth)
        for k in range(len(frames) - 1):
            moved, found, _ = cv2.calcOpticalFlowPyrLK(
                frames[k], frames[k + 1], points, None, winSize=(9, 9), maxLevel=2
            )
            flow[k] = (moved - points)[found == 1].mean(axis=0)
        return flow

    report(benchmark, f"OpenCV Lucas-Kanade, {len(points)} points", track, truth)
