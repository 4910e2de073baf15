"""What every engine does: fly parts of a campaign's cells and give their rows, in the order asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.plan import Ready

Array = NDArray[np.float64]


class Part(NamedTuple):
    """Some flights of a cell: so many from number `first` on; number: of the file that they go to."""

    number: int
    first: int
    flights: int


class Engine(Protocol):
    """Flies flights; the same rows whichever engine does."""

    def fly(
        self, cell: Ready, seed: int, parts: Sequence[Part], on_progress: Callable[[int], object]
    ) -> Iterator[tuple[Part, Array]]:
        """The rows of each part, (flights, len(measures.ROW_COLUMNS)), part by part."""
