"""Springs that stiffen, `lambda = k_1 u + k_3 u^3` in each direction of a pair, without friction or separation."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from solver.contact.element import Element, Marched, numbers_of_pairs
from solver.model import FloatArray, IntArray
from solver.packing import packable


@packable
@dataclass(frozen=True, eq=False)
class CubicSprings:
    """A `PairLaw`: springs in the closing and both tangential directions of some pairs, without force where the pairs
    just close. A pair between a displacement and the ground is one whose relative displacement is that displacement.

    pairs: ascending indices. linear, cubic (k, 3), (3,) for all of them, or one number: k_1, N/m, and k_3, N/m3.
    Raises ValueError where a number is below 0 or not finite, or shapes do not fit.
    """

    pairs: tuple[int, ...]
    linear: FloatArray
    cubic: FloatArray

    def __post_init__(self) -> None:
        for name in ("linear", "cubic"):
            numbers_of_pairs(self, name, (3,))

    @property
    def rest_stiffness(self) -> FloatArray:
        """As in `PairLaw`: k_1."""
        return self.linear

    def element(self, places: IntArray, *of_pairs: Any) -> "SpringPairs":
        """As in `PairLaw`."""
        return SpringPairs(places, *of_pairs, springs=self)


@dataclass(frozen=True, kw_only=True)
class SpringPairs(Element):
    """Pairs on springs. With `x = eps u` a sample obeys `(1 + k_1 / eps) x + k_3 / eps^3 x^3 = p`."""

    springs: CubicSprings

    @property
    def _coefficients(self) -> tuple[FloatArray, FloatArray]:
        """Those of x and x^3 (k, 3, 1), the latter in 1 / N^2."""
        eps = self.penalty.stiffness
        return (1.0 + self.springs.linear / eps)[:, :, None], (self.springs.cubic / eps**3)[:, :, None]

    def march(self, predicted_h: FloatArray, _: FloatArray, __: FloatArray | None, /) -> Marched:  # noqa: D102
        predicted_t = predicted_h @ self.basis.synthesis
        first, third = self._coefficients
        # the real root of the cubic equation; the quotient is 1 where the spring is linear or without force
        argument = predicted_t * np.sqrt(6.75 * third / first**3)
        reduced = 3.0 * np.sinh(np.arcsinh(argument) / 3.0)
        share = np.divide(reduced, argument, out=np.ones_like(argument), where=argument != 0.0)
        there = (self.dofs >= 0)[:, :, None]
        return self.marched(predicted_t, predicted_t - np.where(there, share * predicted_t / first, 0.0))

    def sample_tangents(self, at: Marched, stride: int = 1) -> tuple[FloatArray, FloatArray]:  # noqa: D102
        first, third = self._coefficients
        state = (at.predicted_t - at.force_t)[:, :, ::stride]
        slope = 1.0 / (first + 3.0 * third * state**2)
        n = slope.shape[2]
        return slope.transpose(2, 0, 1)[..., None] * np.eye(3), np.zeros((n, len(slope), 2, 2))
