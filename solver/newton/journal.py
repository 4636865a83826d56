"""The journal of a search that may be interrupted: the results of its solves, in their order.

A search that is interrupted begins once more at its last saved state and asks for the same results in the same order.
Results in the journal are taken from there, so that the search soon arrives where it was interrupted.

The last bits of a solve depend on the factorisation that a solver keeps from the solves before, which is not saved. So
all solvers drop their factorisations at save points, which are given by the number of results alone. Only results
before the last save point are saved. All later ones are computed again, and are equal to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar, cast

import numpy as np

T = TypeVar("T")

Results = tuple[tuple[object, ...], ...]
"""Results in their order: (value,), or () where the matrix was singular."""

RESULTS_PER_SAVE = 12
"""Results from one save point to the next: 0.2 s of the dovetail with 48 pairs, 4 s with 336. In any case a new
factorisation is built about once in two results. After as many results a sweep is saved at its next node."""


class KeepsFactor(Protocol):
    """Required of a solver: to drop the factorisation of an earlier epoch."""

    def renew(self, epoch: int) -> None:
        """Drop the factorisation unless it was kept in this epoch."""


def _nothing() -> None:
    """Save nothing."""


class Journal:
    """Results of one search since its last saved state.

    Attributes
    ----------
    save : callable
        Called at each save point.
    """

    def __init__(self, save: Callable[[], None] = _nothing) -> None:
        self.save = save
        self._results: list[tuple[object, ...]] = []
        self._place = self._n_saved = self._epoch = 0

    def __len__(self) -> int:
        """Number of results that the search has asked for since its last saved state."""
        return self._place

    @property
    def saved(self) -> Results:
        """Results before the last save point."""
        return tuple(self._results[: self._n_saved])

    def begin(self, results: Results = ()) -> None:
        """Begin at a saved state with the results of an interrupted search, none by default."""
        self._results, self._place, self._n_saved = list(results), 0, len(results)
        self._epoch += 1

    def once(self, solver: KeepsFactor, compute: Callable[[], T], fits: Callable[[object], bool]) -> T:
        """The next result: from the journal, or else computed.

        Parameters
        ----------
        solver
            The solver of the computation.
        compute
            Computes the result.
        fits
            Whether a result from the journal is one of this computation. On another processor the last bits differ, so
            that the search may take other steps. Then this result and all behind it are computed anew.

        Raises
        ------
        LinAlgError
            The matrix is singular, now or in the journal.
        """
        if self._place < len(self._results) and not all(map(fits, self._results[self._place])):
            del self._results[self._place :]
            self._n_saved = self._place - self._place % RESULTS_PER_SAVE
        known = self._place < len(self._results)
        if self._place and self._place % RESULTS_PER_SAVE == 0:
            self._epoch += 1
            if self._n_saved < self._place:
                self._n_saved = self._place
                self.save()
        solver.renew(self._epoch)
        if not known:
            try:
                self._results.append((compute(),))
            except np.linalg.LinAlgError:
                self._results.append(())
        result = self._results[self._place]
        self._place += 1
        if not result:
            raise np.linalg.LinAlgError
        return cast("T", result[0])
