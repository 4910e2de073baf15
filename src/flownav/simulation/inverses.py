"""The distributions that dispersions are mostly made of, by their inverses: SciPy's numbers to the last bit, without
`scipy.stats`, which takes 46 MB and half a second. What they need of SciPy is loaded at the first draw.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from flownav.core.measurement import Array


class Family(NamedTuple):
    """A kind of distributions, of location 0 and scale 1."""

    shapes: tuple[str, ...]
    holds: Callable[..., bool]  # whether it can have such shape parameters, as far as it is known here
    support: Callable[..., tuple[float, float]]
    inverse: Callable[..., Array]  # of shares in (0, 1), and the shape parameters


class Inverse(NamedTuple):
    """A distribution as a campaign uses it; it stands for SciPy's of the same family."""

    family: Family
    shapes: tuple[float, ...]
    loc: float
    scale: float

    def support(self) -> tuple[float, float]:
        """The least and the largest number."""
        low, high = self.family.support(*self.shapes)
        return low * self.scale + self.loc, high * self.scale + self.loc

    def ppf(self, shares: Any) -> Any:
        """The numbers with these shares of the distribution below them; NaN where a number is no share."""
        q = np.asarray(shares, float)
        low, high = self.support()
        inside = (q > 0.0) & (q < 1.0)
        found = np.where(q == 0.0, low, np.where(q == 1.0, high, np.nan))
        found[inside] = self.family.inverse(q[inside], *self.shapes) * self.scale + self.loc
        return found[()]


def _truncated(q: Array, a: float, b: float) -> Array:
    """The normal distribution between a < 0 and b > 0: by logarithms, as SciPy has it."""
    from scipy.special import log1p, log_ndtr, logsumexp, ndtr, ndtri_exp

    mass = log1p(-ndtr(a) - ndtr(-b))
    logs = np.log(q) + mass
    return np.asarray(ndtri_exp(logsumexp([np.full_like(logs, log_ndtr(a)), logs], axis=0)))


def _normal(q: Array) -> Array:
    from scipy.special import ndtri

    return np.asarray(ndtri(q))


def _beta(q: Array, a: float, b: float) -> Array:
    from scipy.special import betaincinv

    return np.asarray(betaincinv(a, b, q))


FAMILIES: Mapping[str, Family] = {
    "norm": Family((), lambda: True, lambda: (-np.inf, np.inf), _normal),
    "uniform": Family((), lambda: True, lambda: (0.0, 1.0), lambda q: q),
    "lognorm": Family(("s",), lambda s: s > 0.0, lambda s: (0.0, np.inf), lambda q, s: np.exp(s * _normal(q))),
    "loguniform": Family(
        ("a", "b"), lambda a, b: 0.0 < a < b, lambda a, b: (a, b),
        lambda q, a, b: np.exp(np.log(a) + q * (np.log(b) - np.log(a))),
    ),
    "beta": Family(
        ("a", "b"), lambda a, b: a > 0.0 and b > 0.0, lambda a, b: (0.0, 1.0), _beta
    ),
    "truncnorm": Family(("a", "b"), lambda a, b: a < 0.0 < b, lambda a, b: (a, b), _truncated),
}  # fmt: skip


def inverse_of(name: str, shapes: Mapping[str, float], loc: float, scale: float) -> Inverse | None:
    """A distribution by SciPy's names; None of another family, and of parameters that the family cannot have, for which
    SciPy gives the reason.
    """
    family = FAMILIES.get(name)
    if family is None or sorted(family.shapes) != sorted(shapes):
        return None
    shape = tuple(float(shapes[key]) for key in family.shapes)
    found = Inverse(family, shape, float(loc), float(scale)) if family.holds(*shape) and scale > 0.0 else None
    return found if found is not None and np.isfinite(found.ppf(0.5)) else None
