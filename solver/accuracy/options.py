"""Tuning constants of the accuracy control: certificate, numbers of harmonics, error estimates, refinement."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class AccuracyOptions:
    """Limits and safety factors: for each its meaning, its unit (none: a ratio) and the evidence for its value.

    "Good states" are those in the table of `solver.accuracy.certificate`. "Level": an entry of `harmonic_levels`.
    """

    # certificate
    penetration_limit: float = 0.1
    """Fraction of the largest relative motion. Good: 0.13 at one harmonic of vibro-impact, 0.02 on the dovetail."""
    violation_limit: float = 0.05
    """Energy imbalance over the largest work in a period. Good states: up to 0.01 (vibro-impact). Friction above its
    limit over the largest limit. Good states: below 1e-12, and 0.018 in a joint with five harmonics at fifty times its
    load; 10 % more friction is found."""
    law_limit: float = 1e-3
    """Tension over the largest normal force, and change of the tangential force over a period over the largest friction
    limit. Good states: up to 1e-12 and 8e-7; slip that does not repeat by 2 % is found."""

    # numbers of harmonics
    harmonic_levels: tuple[int, ...] = (1, 3, 5, 9, 13, 19, 27, 39, 55, 79, 115, 165, 235, 331, 469)
    """Highest harmonics between which "auto" chooses. The last two serve for comparison only. 7 is left out: on the
    dovetail, states with five and seven harmonics agree by chance (212 Hz: errors of the worn volume of 1.9, 1.2 and
    0.1 % with 5, 7 and 9)."""
    most_mixed_harmonics: int = 79
    """Highest harmonic of "auto" with even harmonics: motions with impacts gain nothing from more."""
    displacements_of_limits: int = 144
    """Number of relative displacements of the dovetail with 48 pairs, to which the limits of unknowns belong. For a
    larger joint some limits grow in proportion, so that they limit the harmonics and not the pairs."""
    node_unknowns: int = 1600
    """Most unknowns of a node of a sweep: about those of the dovetail of 48 pairs with five harmonics (1584). Most
    unknowns of a small joint, too: impacts couple all harmonics, and no preconditioner helps."""
    stiffness_mismatch: float = 0.25
    """Largest |1 - E G|: above, structure and penalty answer differently, and more harmonics are needed."""

    # states at other resolutions
    far_unknowns: int = 400
    """Most unknowns of a balance that only resolves a short contact, or the structure at higher harmonics."""
    two_levels_safety: float = 1.5
    """Error over the difference to the state two levels up, 2 to 1.2 where the error falls as 1/H to 1/H^3, and over
    the difference to twice the samples, 2 to 1.3 for an error as the time step or its square."""
    one_level_safety: float = 2.5
    """Error over the difference to the state one level up: 3.4 to 1.5 for an error as 1/H to 1/H^3."""
    triple_samples_safety: float = 2.0
    """Error over the difference to three times the samples: 1.5 to 1.1, but the errors of single events scatter."""
    small_work: float = 1e-3
    """Fraction of a larger work to which the error of a smaller one is relative. Slip work over the work of the
    excitation; where it is below this fraction of this fraction, nothing wears. Balance of energy over the elastic work
    (a loss factor too small to influence any structure). Oscillation of the wear rate of a pair over the wear rate of
    the joint."""
    negligible: float = 0.1
    """Fraction of rtol: part of the slip work that may be creep, and normal force over the largest one below which a
    contact need not be resolved."""
    small_peak: float = 0.01
    """Fraction of the largest peak: errors of smaller responses are relative to this fraction."""
    kept_fraction: float = 0.5
    """Fraction of rtol: error up to which harmonics are removed, so that the next state does not add them at once. A
    state with less than this fraction of the kept error is tried with fewer harmonics and samples."""

    # refinement
    most_samples: int = 8192
    """Most samples of a period that "auto" takes."""
    samples_of_unknowns: int = 512
    """Most samples of a period at the largest number of unknowns; more with fewer unknowns. Nine pairs of a blade that
    lift off at 2000 N: without this limit 27 harmonics take 8192 samples, 0.2 s an iteration, and the wear rate at the
    edge of the contact is no more accurate than with 2048."""
    refinement_work: float = 1.2e6
    """Most Newton iterations of one refinement, times the unknowns two levels up. Failed solves take most of them. A
    joint of 48 pairs with nine harmonics may take 200."""
    most_unknowns: int = 8000
    """Most unknowns of a balance in a history with "auto". States to compare with may have `compared_unknowns`."""
    vibration_recheck: float = 0.3
    """Relative change of the vibration after which errors are estimated and harmonics chosen again. Error of the motion
    of the dovetail on the far side of the resonance: 5 % with 1.0, 0.5 % with 0.3."""

    # wear histories
    history_safety: float = 1.5
    """Error of a history over its difference to the reference solution. Dovetail, 16 and 48 pairs, all schemes, steps
    of 250 to 2000 cycles: 0.02 to 1.4, in the median 0.3."""
    pair_over_volume: float = 2.0
    """Relative error of the depth of a pair over that of the worn volume, at least, where four or more pairs wear. With
    1 the deepest pairs of the dovetail at mu = 0.3 are outside of their errors by 2.7 times, and explicit steps at
    212.5 Hz, 48 pairs, by 3.2 times."""
    crossing_window: float = 0.5
    """Fraction of the cycle count. Two histories in which an event happens at different counts cross each other. So the
    error is the largest difference from this fraction of the count on (dovetail, 211.25 Hz, steps of 2000 cycles:
    without it the estimate at the crossing is a quarter of the true error). Later differences are not used: an error
    does not depend on the length of the study."""

    @property
    def compared_unknowns(self) -> int:
        """Most unknowns of a balance that is solved to estimate an error."""
        return 3 * self.most_unknowns // 2

    @property
    def violation_limits(self) -> dict[str, float]:
        """Limits of the violations of a certificate; response and wear rate have error estimates instead."""
        return {
            "penetration": self.penetration_limit,
            "tension": self.law_limit,
            "cone_violation": self.violation_limit,
            "energy_error": self.violation_limit,
            "periodicity_error": self.law_limit,
        }


ACCURACY = AccuracyOptions()
