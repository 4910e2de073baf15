"""Several runs and heights of the experiment, as the paper made them: four heights, seven models each."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

from flownav.lab.rig.experiment import RigLog, RigSettings, check, run_experiment

PAPER_HEIGHTS_M = (0.6, 0.8, 1.0, 1.5)


def run_campaign(
    settings: RigSettings,
    heights_m: Sequence[float] = PAPER_HEIGHTS_M,
    on_run: Callable[[int], object] = lambda done: None,
) -> Iterator[RigLog]:
    """Every run (1 to `settings.runs`) at every height, in that order; InputError before the first where one is bad.

    The kernels release the interpreter, so runs proceed side by side on the machine's cores.
    """
    jobs = [(settings.at(height), run) for height in heights_m for run in range(1, settings.runs + 1)]
    for job, _ in jobs:
        check(job)
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        for log in pool.map(lambda job: run_experiment(*job), jobs):
            on_run(1)
            yield log
