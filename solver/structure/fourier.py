"""The Fourier basis, Eq. (5): the order of the harmonics, and the transforms between harmonics and time.

Harmonics are real, in the order 0, cos 1, sin 1, cos 2, sin 2, ... (`2 H + 1` of them, on the last axis). Time samples
are equally spaced over one period, the first at phase 0 (`N` of them, on the last axis). A complex amplitude `X` of
harmonic n means `x(t) = Re(X exp(i n w t))`, so `X = cosine - i sine`.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from solver.model import ComplexArray, FloatArray


@dataclass(frozen=True)
class FourierBasis:
    """Matrices between H harmonics, of any orders, and N time samples.

    orders (H,): ascending. n_samples: N.
    synthesis (2H+1, N), analysis (N, 2H+1): `x_t = x_h @ synthesis`, `x_h = x_t @ analysis`.
    """

    orders: tuple[int, ...]
    n_samples: int
    synthesis: FloatArray
    analysis: FloatArray

    @cached_property
    def step_mean(self) -> FloatArray:
        """Ratio (2H+1,) of the harmonics of means over a step around each sample to the harmonics of the samples."""
        angle = np.pi * np.array(self.orders) / self.n_samples
        return np.concatenate([[1.0], np.repeat(np.sin(angle) / angle, 2)])


@lru_cache(maxsize=32)
def build_basis(orders: tuple[int, ...], n_samples: int) -> FourierBasis:
    """Fourier basis, Eq. (5), of harmonics above the static one, ascending, and of N samples.

    Raises ValueError where the highest order is not below N/2: aliasing.
    """
    highest = max(orders, default=0)
    if n_samples <= 2 * highest:
        raise ValueError(f"{n_samples} samples cannot tell {highest} harmonics apart")
    to_time = synthesis(orders, 2.0 * np.pi * np.arange(n_samples) / n_samples)
    weight = np.full(2 * len(orders) + 1, 2.0 / n_samples)
    weight[0] = 1.0 / n_samples
    analysis = np.ascontiguousarray((to_time * weight[:, None]).T)
    to_time.flags.writeable = False
    analysis.flags.writeable = False
    return FourierBasis(orders, n_samples, to_time, analysis)


def synthesis(orders: tuple[int, ...], phase: FloatArray) -> FloatArray:
    """Matrix (2H+1, n) of the Fourier series, Eq. (5), at phases (n,), rad: `x = x_h @ synthesis`."""
    angle = np.array(orders, np.float64)[:, None] * phase
    values = np.empty((2 * len(orders) + 1, len(phase)))
    values[0] = 1.0
    values[1::2] = np.cos(angle)
    values[2::2] = np.sin(angle)
    return values


def to_complex(values_h: FloatArray) -> ComplexArray:
    """Complex amplitudes (..., H) of the harmonics 1..H of real coefficients (..., 2H+1)."""
    return values_h[..., 1::2] - 1j * values_h[..., 2::2]


def with_static(values_h: FloatArray) -> ComplexArray:
    """Complex amplitudes (..., H+1) of real coefficients (..., 2H+1), the static one first."""
    return np.concatenate([values_h[..., :1].astype(np.complex128), to_complex(values_h)], axis=-1)


def from_complex(static: FloatArray, amplitudes: ComplexArray) -> FloatArray:
    """Real coefficients (..., 2H+1) from the static part (...) and the complex amplitudes (..., H)."""
    values_h = np.empty((*static.shape, 2 * amplitudes.shape[-1] + 1))
    values_h[..., 0] = static
    values_h[..., 1::2] = amplitudes.real
    values_h[..., 2::2] = -amplitudes.imag
    return values_h


def derivative(values_h: FloatArray, rates: FloatArray) -> FloatArray:
    """Time derivative (..., 2H+1) of a Fourier series; rates (H,): angular frequencies of its harmonics, rad/s."""
    rate_h = np.zeros_like(values_h)
    rate_h[..., 1::2] = rates * values_h[..., 2::2]
    rate_h[..., 2::2] = -rates * values_h[..., 1::2]
    return rate_h


def change_orders(values_h: FloatArray, orders: tuple[int, ...], wanted: tuple[int, ...]) -> FloatArray:
    """The series with other harmonics, (..., 2H+1): new harmonics are zero, unwanted harmonics are truncated."""
    changed = np.zeros((*values_h.shape[:-1], 2 * len(wanted) + 1))
    changed[..., 0] = values_h[..., 0]
    for place, order in enumerate(wanted):
        if order in orders:
            old = orders.index(order)
            changed[..., 2 * place + 1 : 2 * place + 3] = values_h[..., 2 * old + 1 : 2 * old + 3]
    return changed
