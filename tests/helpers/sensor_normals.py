"""Bundles of standard normals for sensor tests: silent ones, drawn ones, and which outputs each of them moves."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, TypeVar

import numpy as np

Bundle = TypeVar("Bundle", bound=tuple[Any, ...])


def silent(bundle: type[Bundle], **given: float) -> Bundle:
    """All zero but those given."""
    return bundle(**{name: given.get(name, 0.0) for name in bundle._fields})  # type: ignore[attr-defined]


def draws(bundle: type[Bundle], count: int, seed: int) -> Iterable[Bundle]:
    """`count` bundles of independent standard normals."""
    width = len(bundle._fields)  # type: ignore[attr-defined]
    for row in np.random.default_rng(seed).standard_normal((count, width)):
        yield bundle(*map(float, row))


def moved_by(bundle: type[Bundle], outputs: Callable[[Bundle], Any], by: float = 0.5) -> dict[str, set[str]]:
    """For each normal the outputs (fields of a named tuple) that change when it alone is not zero."""
    still = outputs(silent(bundle))
    moved = {}
    for name in bundle._fields:  # type: ignore[attr-defined]
        other = outputs(silent(bundle, **{name: by}))
        moved[name] = {field for field, a, b in zip(still._fields, still, other, strict=True) if a != b}
    return moved
