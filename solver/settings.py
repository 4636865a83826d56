"""Numerical settings of the solver, all with defaults."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

from solver.packing import packable

Automatic = Literal["auto"]
Scheme = Literal["explicit", "implicit", "adaptive"]
"""Of the steps on the slow time scale."""


Quantity = Literal["wear_depth", "worn_volume", "frequency_shift"]
TARGETS: tuple[Quantity, ...] = get_args(Quantity)
"""What a target may be of."""


@dataclass(frozen=True)
class WearTarget:
    """Wear at which a march ends.

    quantity: "wear_depth", of the deepest pair, m, "worn_volume", of all pairs, m3, or "frequency_shift", by how much
    the resonance of the vibration (`results.resonance`) has changed, up or down, relative. value: above 0.
    """

    quantity: Quantity
    value: float


@dataclass(frozen=True)
class ToTheEnd:
    """In place of cycle counts: a march until nothing wears any more.

    n_outputs: states that are kept, the first and the last included, spaced evenly in worn volume and cycles; at
        least 2.
    final_share: the march ends where the wear rate of every pair is below this share of the largest that it has had;
        what a pair has worn at is counted as at least that share of the largest of all pairs.
    """

    n_outputs: int
    final_share: float = 1e-4


@dataclass(frozen=True)
class SolverSettings:
    """How finely and how exactly a case is solved.

    harmonics: number H of harmonics above the static one, or "auto": those that the state needs for `rtol`.
    samples: N, equally spaced time samples in a period, at which the contact law is applied, more than 2 H; or "auto".
    tolerance: largest accepted scaled residual of the harmonic balance.
    rtol: relative error of response and wear rate that automatic harmonics and samples aim at.
    time_limit: CPU seconds that a start state with its loading history may take, or a march, before it is given up;
        without those that kernels are compiled in.
    """

    harmonics: int | Automatic = "auto"
    samples: int | Automatic = "auto"
    tolerance: float = 1e-8
    rtol: float = 1e-2
    time_limit: float = math.inf

    @property
    def automatic(self) -> bool:
        """Whether anything is chosen by the state."""
        return self.harmonics == "auto" or self.samples == "auto"


@packable
@dataclass(frozen=True)
class Resolution:
    """Harmonics and samples of one solve.

    orders: harmonics above the static one, ascending, the first 1. samples: N, more than twice the highest.
    """

    orders: tuple[int, ...]
    samples: int

    @property
    def highest(self) -> int:
        """Highest harmonic."""
        return self.orders[-1] if self.orders else 0


def all_orders(n_harmonics: int) -> tuple[int, ...]:
    """Every harmonic from the first one on."""
    return tuple(range(1, n_harmonics + 1))


@dataclass(frozen=True)
class ResolutionOptions:
    """What automatic harmonics and samples begin with, each with the evidence for its value."""

    first_harmonics: int = 3
    """Harmonics of the first state: the fewest that friction is seen in."""
    fewest_samples: int = 64
    """Samples in a period; with fewer the samples, not the harmonics, limit a slider with one harmonic."""
    samples_per_harmonic: int = 8
    """Samples in a period of the highest harmonic."""


RESOLUTION = ResolutionOptions()


def samples_for(highest: int) -> int:
    """Samples, a power of two, with which the harmonics up to the highest one are resolved."""
    wanted = max(RESOLUTION.fewest_samples, RESOLUTION.samples_per_harmonic * highest)
    return 1 << (wanted - 1).bit_length()


def first_resolution(settings: SolverSettings) -> Resolution:
    """The resolution that the settings fix, or the one that automatic settings begin with."""
    n_harmonics = RESOLUTION.first_harmonics if settings.harmonics == "auto" else settings.harmonics
    samples = samples_for(n_harmonics) if settings.samples == "auto" else settings.samples
    return Resolution(all_orders(n_harmonics), samples)


def allowed(resolution: Resolution, settings: SolverSettings) -> Resolution:
    """The resolution that comes nearest to one where harmonics or samples are fixed."""
    fixed = first_resolution(settings)
    return Resolution(
        resolution.orders if settings.harmonics == "auto" else fixed.orders,
        resolution.samples if settings.samples == "auto" else fixed.samples,
    )
