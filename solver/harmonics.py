"""The Fourier basis: one ordering, and the way between harmonics and time.

Harmonics are real, in the order 0, cos 1, sin 1, cos 2, sin 2, ... (`2 H + 1` of them, on the last axis). Time samples
are equally spaced over one period, the first at phase 0 (`N` of them, on the last axis). A complex amplitude `X` of
harmonic n means `x(t) = Re(X exp(i n w t))`, so `X = cosine - i sine`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from solver.model import ComplexArray, FloatArray


@dataclass(frozen=True)
class FourierBasis:
    """Matrices between harmonics and time samples.

    synthesis (2H+1, N): `x_t = x_h @ synthesis`. analysis (N, 2H+1): `x_h = x_t @ analysis`.
    """

    n_harmonics: int
    n_samples: int
    synthesis: FloatArray
    analysis: FloatArray


@lru_cache(maxsize=16)
def build_basis(n_harmonics: int, n_samples: int) -> FourierBasis:
    """Fourier basis, Eq. (5). Raises ValueError where `n_samples <= 2 n_harmonics`: samples would alias."""
    if n_samples <= 2 * n_harmonics:
        raise ValueError(f"{n_samples} samples cannot tell {n_harmonics} harmonics apart")
    phase = 2.0 * np.pi * np.arange(n_samples) / n_samples
    synthesis = np.empty((2 * n_harmonics + 1, n_samples))
    synthesis[0] = 1.0
    for harmonic in range(1, n_harmonics + 1):
        synthesis[2 * harmonic - 1] = np.cos(harmonic * phase)
        synthesis[2 * harmonic] = np.sin(harmonic * phase)
    weight = np.full(2 * n_harmonics + 1, 2.0 / n_samples)
    weight[0] = 1.0 / n_samples
    analysis = np.ascontiguousarray((synthesis * weight[:, None]).T)
    synthesis.flags.writeable = False
    analysis.flags.writeable = False
    return FourierBasis(n_harmonics, n_samples, synthesis, analysis)


def to_complex(values_h: FloatArray) -> ComplexArray:
    """Complex amplitudes (..., H) of the harmonics 1..H of real coefficients (..., 2H+1)."""
    return values_h[..., 1::2] - 1j * values_h[..., 2::2]


def from_complex(static: FloatArray, amplitudes: ComplexArray) -> FloatArray:
    """Real coefficients (..., 2H+1) from the static part (...) and the complex amplitudes (..., H)."""
    values_h = np.empty((*static.shape, 2 * amplitudes.shape[-1] + 1))
    values_h[..., 0] = static
    values_h[..., 1::2] = amplitudes.real
    values_h[..., 2::2] = -amplitudes.imag
    return values_h


def derivative(values_h: FloatArray, omega: float) -> FloatArray:
    """Time derivative (..., 2H+1) of a Fourier series; `omega` in rad/s."""
    order = omega * np.arange(1, (values_h.shape[-1] - 1) // 2 + 1)
    rate_h = np.zeros_like(values_h)
    rate_h[..., 1::2] = order * values_h[..., 2::2]
    rate_h[..., 2::2] = -order * values_h[..., 1::2]
    return rate_h


def pad_harmonics(values_h: FloatArray, n_harmonics: int) -> FloatArray:
    """The same series with zeros above, or cut to, `n_harmonics`; (..., 2H+1)."""
    padded = np.zeros((*values_h.shape[:-1], 2 * n_harmonics + 1))
    kept = min(values_h.shape[-1], padded.shape[-1])
    padded[..., :kept] = values_h[..., :kept]
    return padded
