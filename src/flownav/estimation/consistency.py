"""How far the truth lies, in stated units."""

from flownav.core.compile import Lanes, Work, equation
from flownav.estimation.covariance import covariance_of
from flownav.estimation.states import SCRATCH, STATE

SCORED = 6
Six = tuple[float, float, float, float, float, float]


@equation
def normalised_error(work: Work, lanes: Lanes, lane: int, truth: Six) -> float:
    """e' P^-1 e of one lane's position and velocity NED, by elimination in the filter's scratch."""
    error, square = SCRATCH, SCRATCH + SCORED
    for i in range(SCORED):
        work[(error + i) * len(lanes) + lane] = work[(STATE + i) * len(lanes) + lane] - truth[i]
        for j in range(SCORED):
            work[(square + i * SCORED + j) * len(lanes) + lane] = covariance_of(work, lanes, i, j, lane)
    total = 0.0
    for k in range(SCORED):
        pivot = work[(square + k * (SCORED + 1)) * len(lanes) + lane]
        e = work[(error + k) * len(lanes) + lane]
        total += e * e / pivot
        for i in range(k + 1, SCORED):
            share = work[(square + i * SCORED + k) * len(lanes) + lane] / pivot
            work[(error + i) * len(lanes) + lane] -= share * e
            for j in range(k + 1, SCORED):
                taken = share * work[(square + k * SCORED + j) * len(lanes) + lane]
                work[(square + i * SCORED + j) * len(lanes) + lane] -= taken
    return total
