"""The posterior Cramér-Rao bound of a linear, or nearly linear, model with Gaussian noise.

No estimator of x_k from z_1..z_k has a mean squared error below the inverse of the information J_k of Tichavský,
Muravchik and Nehorai, Posterior Cramér-Rao bounds for discrete-time nonlinear filtering, IEEE Transactions on Signal
Processing 46(5), 1998, equations 21 and 34-36. A nonlinear model hands in its Jacobians along the truth.
"""

from collections.abc import Sequence

import numpy as np

from flownav.core.measurement import Array


def posterior_bound(
    transitions: Sequence[Array],
    process_noises: Sequence[Array],
    observations: Sequence[Array],
    measurement_noises: Sequence[Array],
    initial: Array,
) -> Array:
    """The bound after each of K steps, (K, n, n): covariances, of the units of the state squared.

    Step k moves x <- F x + w, w of covariance Q (n, n), both of `transitions` and `process_noises`, then observes
    z = H x + v, v of covariance R: `observations` (m, n) and `measurement_noises` (m, m), where m may differ from
    step to step and may be 0. initial (n, n): covariance before the first step. ValueError where the lists differ in
    length; LinAlgError where Q, R or `initial` has no inverse.
    """
    if len({len(transitions), len(process_noises), len(observations), len(measurement_noises)}) != 1:
        raise ValueError("transitions, process_noises, observations and measurement_noises differ in length")
    information = np.linalg.inv(np.asarray(initial, float))
    bounds = np.empty((len(transitions), *information.shape))
    steps = zip(transitions, process_noises, observations, measurement_noises, strict=True)
    for k, (transition, process_noise, observation, measurement_noise) in enumerate(steps):
        certainty = np.linalg.inv(process_noise)
        d11 = transition.T @ certainty @ transition
        d12 = -transition.T @ certainty
        d22 = certainty + observation.T @ np.linalg.solve(measurement_noise, observation)
        information = d22 - d12.T @ np.linalg.solve(information + d11, d12)
        information = 0.5 * (information + information.T)
        bounds[k] = np.linalg.inv(information)
    return bounds
