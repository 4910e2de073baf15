"""The classical Runge-Kutta method of fourth order, stage by stage and as a whole step.

Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, 1993, table II.1.2.
"""

from collections.abc import Callable
from typing import Any

from flownav.core.compiling.engine import equation

STAGES = 4


@equation
def share(stage: int, dt: float) -> float:
    """How long a stage's rate counts in a step of dt: a sixth of it at its ends, a third for each of the two within."""
    return dt / 3.0 if stage == 1 or stage == 2 else dt / 6.0


@equation
def reach(stage: int, dt: float) -> float:
    """How long a stage's rate is followed from the start of a step of dt to the stage after it."""
    return 0.5 * dt if stage < 2 else dt


def runge_kutta(moved: Callable[[Any, Any, float], Any]) -> tuple[Callable[..., tuple[Any, Any]], Callable[..., Any]]:
    """Two equations, `(after, step)`, for states that `moved(state, rate, dt)` carries on: state + rate·dt.

    after(stage, start, total, rate, dt): the step's sum with the rate of a stage (0 to 3), and the next stage's state;
    the sum begins as the start, and with all four it is the state after the step. step(rate, start, dt, *held): the
    state after dt by `rate(state, *held)`.
    """

    @equation
    def after(stage: int, start: Any, total: Any, rate: Any, dt: float) -> tuple[Any, Any]:
        return moved(total, rate, share(stage, dt)), moved(start, rate, reach(stage, dt))

    @equation
    def step(rate: Callable[..., Any], start: Any, dt: float, *held: Any) -> Any:
        total = state = start
        for stage in range(STAGES):
            total, state = after(stage, start, total, rate(state, *held), dt)
        return total

    return after, step
