"""Numerical settings of the solver, all with defaults."""

import math
from dataclasses import dataclass, replace
from typing import Literal, get_args

from solver.packing import packable

ROUND_OFF = 1e-9
"""Fraction of a quantity that is round-off after a computation of many steps. Changes of a periodic tangential state:
1e-12 and below. Eigenvalues of a stiffness over the largest one: 1e-15 for the free direction of the dovetail, -1.6e-6
for the next one. Its inverse is practically infinite."""

NEGLIGIBLE = 1e-6
"""Fraction of a quantity that has no meaning although it may be more than round-off: a vibration over its mean, at a
tolerance of 1e-8; pressure and depth at the edge of a contact over the largest ones (a scar that is cut off: 0.96); the
squared frequency of a rigid motion (with 1e-4 the modes of dovetail and foot are equal to 1e-8)."""

SMALL = 1e-3
"""Fraction of a work or a motion that is small beside another one: slip work beside the work of the excitation, an
error of energy beside elastic work, slip of a pair beside its motion. Half and twice: slider, masses, blocks and
impacts are equal, ring and damper within 2e-3."""

DIFFERENCE = 1e-7
"""Step of a finite difference over the natural size of its variable: round-off of 1e-16 gives an error of 1e-9. With
ten and a hundred times the value nonlinear modes are equal to 1e-9 and take up to 15 % longer. With 1.5e-8 curves of
vibro-impact and slider are equal to 1e-12."""

FIRST_HARMONICS = 3
"""Harmonics of the first state with automatic harmonics: the smallest number that shows friction."""

FEWEST_SAMPLES = 64
"""Automatic samples in a period. With fewer, they limit the accuracy of a slider with H = 1, and not the harmonics."""

SAMPLES_PER_HARMONIC = 8
"""Automatic samples in one period of the highest harmonic. Half and twice, also of `FEWEST_SAMPLES`: sliders, masses,
waves, spheres and impacts are within their errors, with 24 and 3 % more iterations."""

FINE_SAMPLES = 2048
"""Points of a period in the search for a missed event and for the largest response: a sine can exceed a limit between
them by 1e-6 only, and a peak of harmonic 20 is found to 0.05 %."""

ROUGH_SHARE = 1e-4
"""Largest residual of a state that is no result, over rtol. Dovetail, 16 pairs, 212.42 Hz: with ten times this value
sweeps in fine steps come to motions that differ by 0.8 %, with this one they agree within 2e-5. Half and twice: slider,
masses, blocks and impacts are equal, ring and damper within 2e-3."""

STEP_SHARE = 1e-3
"""Largest residual of a state of an adaptive history, over rtol. Steps err by 100 times as much. Dovetail, 16 and 48
pairs: volumes equal to 2e-4, and 0.7 times the iterations of states with a residual of 1e-8."""

SHARE_OF_CAUSE = 0.5
"""Share of rtol of one of two errors that add up: by harmonics or samples, up to which these are not refined; up to
which harmonics are removed, so that the next state does not add them at once; by the steps of missions beside their
blocks. Slider, missions: estimated over true error at least 1.7. With 0.25 two cases of the tests compute 21.5 and 33
of 2000 missions, with 0.5 fewer than 20 and 30."""

SMALL_SHARE = 0.1
"""Share of rtol of what adds up, the local errors of the steps of a history. Dovetail, 16 pairs, 212.5 Hz, where a pair
only just slips, `rtol` 1e-2: 0.1 % off at the end; with 0.25 0.8 % off on the way, with 0.5 5 %."""

Automatic = Literal["auto"]
Scheme = Literal["explicit", "implicit", "adaptive"]
"""Scheme of the steps on the slow time scale."""

Direction = Literal["up", "down", "ramp"]
"""Way to the unworn state: up or down along the frequency, or with rising excitation at one frequency."""

Followed = Literal["resonance", "peak"]
FOLLOWED: tuple[Followed, ...] = get_args(Followed)
"""What the frequency of an excitation may follow."""

Quantity = Literal["wear_depth", "worn_volume", "frequency_shift"]
TARGETS: tuple[Quantity, ...] = get_args(Quantity)
"""Quantities of a target."""


@packable
@dataclass(frozen=True)
class WearTarget:
    """Wear at which a history ends.

    quantity: "wear_depth" of the deepest pair, m; "worn_volume" of all pairs, m3; or "frequency_shift", the relative
    change of the resonance of the vibration (`results.state_report`), up or down. value: above 0.
    """

    quantity: Quantity
    value: float


@dataclass(frozen=True)
class ToTheEnd:
    """In place of cycle counts: until nothing wears any more; as `outputs`, `final_share` of `solver.march_wear`."""

    n_outputs: int
    final_share: float = 1e-4


@dataclass(frozen=True)
class FollowedFrequency:
    """Excitation whose frequency follows the structure while the joint wears.

    of: as `frequency` of `solver.march_wear`. low, high: Hz.
    """

    of: Followed
    low: float
    high: float


@dataclass(frozen=True)
class Passage:
    """Frequencies that a machine passes: start and stop, Hz, not equal, and the rate, Hz/s, above 0 up or down."""

    start: float
    stop: float
    rate: float

    @property
    def cycles(self) -> float:
        """Cycles of one passage."""
        return abs(self.stop**2 - self.start**2) / (2.0 * self.rate)

    @property
    def sweep(self) -> Direction:
        """The direction."""
        return "up" if self.stop > self.start else "down"


@dataclass(frozen=True)
class SolverSettings:
    """Resolution and accuracy of a computation.

    - harmonics: number H of harmonics above the static one, or "auto": as many as the state needs for `rtol`.
    - samples: number N of time samples in a period at which the contact law is applied; more than 2 H, or "auto".
    - tolerance: largest accepted scaled residual of the harmonic balance.
    - rtol: relative error of response and wear rate for which automatic harmonics and samples are chosen.
    - time_limit: CPU seconds, without compiling kernels, after which a start state with its loading history, or a wear
      history, is given up.
    """

    harmonics: int | Automatic = "auto"
    samples: int | Automatic = "auto"
    tolerance: float = 1e-8
    rtol: float = 1e-2
    time_limit: float = math.inf

    @property
    def automatic(self) -> bool:
        """Whether harmonics or samples are chosen automatically."""
        return self.harmonics == "auto" or self.samples == "auto"

    @property
    def rough_tolerance(self) -> float:
        """Tolerance of a state that is no result: on the way of a sweep, or in a comparison."""
        return max(self.tolerance, ROUGH_SHARE * self.rtol)

    @property
    def of_steps(self) -> "SolverSettings":
        """The settings of the states of an adaptive history, whose tolerance follows from the error of its steps."""
        return replace(self, tolerance=max(self.tolerance, STEP_SHARE * self.rtol))


@packable
@dataclass(frozen=True)
class Resolution:
    """Harmonics above the static one, ascending from 1 on, and N time samples, more than twice the highest one."""

    orders: tuple[int, ...]
    samples: int

    @property
    def highest(self) -> int:
        """Highest harmonic."""
        return self.orders[-1] if self.orders else 0


def all_orders(n_harmonics: int) -> tuple[int, ...]:
    """All harmonics from 1 to `n_harmonics`."""
    return tuple(range(1, n_harmonics + 1))


def samples_for(highest: int) -> int:
    """Number of samples, a power of two, that resolves the harmonics up to `highest`."""
    wanted = max(FEWEST_SAMPLES, SAMPLES_PER_HARMONIC * highest)
    return 1 << (wanted - 1).bit_length()


def first_resolution(settings: SolverSettings) -> Resolution:
    """The fixed resolution of the settings, or the first one of automatic settings."""
    n_harmonics = FIRST_HARMONICS if settings.harmonics == "auto" else settings.harmonics
    samples = samples_for(n_harmonics) if settings.samples == "auto" else settings.samples
    return Resolution(all_orders(n_harmonics), samples)


def allowed(resolution: Resolution, settings: SolverSettings) -> Resolution:
    """A resolution with its harmonics or samples replaced where the settings fix them."""
    fixed = first_resolution(settings)
    orders = resolution.orders if settings.harmonics == "auto" else fixed.orders
    # given harmonics may be too many for its samples
    enough = settings.samples == "auto" and resolution.samples > 2 * orders[-1]
    return Resolution(orders, resolution.samples if enough else fixed.samples)
