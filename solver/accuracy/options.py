"""Tuning constants of the accuracy control: certificate, numbers of harmonics, error estimates, refinement."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class AccuracyOptions:
    """Limits and safety factors: for each its meaning, its unit (none: a ratio) and the evidence for its value.

    "Good states" are those in the table of `solver.accuracy.certificate`. "Level": an entry of `harmonic_levels`.
    """

    # shared
    round_off_fraction: float = 1e-6
    """Fraction of a force, a motion or a depth: less is round-off. Good states have 1e-12 and below in the change of
    the tangential state of a pair that sticks, and in the even harmonics of the force of a symmetric joint."""
    negligible: float = 1e-3
    """Fraction of a work or of a wear rate that has no influence: a loss factor that no structure notices, a slip work
    over the work of the excitation."""
    minor: float = 0.1
    """Fraction of a larger quantity that counts little. Of rtol: creep in the slip work, the force of a contact whose
    duration is not resolved, an error far below rtol. Of the largest peak: errors of smaller responses are relative to
    this fraction."""

    # certificate
    penetration_limit: float = 0.1
    """Fraction of the largest relative motion. Good: 0.13 at one harmonic of vibro-impact, 0.02 on the dovetail."""
    tension_limit: float = 0.01
    """Fraction of the largest normal force. Good states: below 1e-12; a pull by 5 % is found."""
    violation_limit: float = 0.05
    """Fraction of the largest friction limit for friction above this limit, of the largest work for the energy of a
    period. Good states: below 1e-12 for friction, up to 0.01 for the energy (vibro-impact); 10 % more friction is
    found. With 0.03 a random joint of three pairs under fifty times its usual load is rejected (energy)."""
    periodicity_limit: float = 1e-3
    """Fraction of the largest friction limit. Good states: up to 8e-7; slip that does not repeat by 2 % is found."""
    residual_round_off: float = 1e-10
    """Lowest tolerance of the scaled residual: 1e-5 of its stiffness holds the mean position of a sliding mass."""

    # numbers of harmonics
    harmonic_levels: tuple[int, ...] = (1, 3, 5, 9, 13, 19, 27, 39, 55, 79, 115, 165, 235, 331, 469)
    """Highest harmonics between which "auto" chooses. The last two serve for comparison only. 7 is left out: on the
    dovetail, states with five and seven harmonics agree by chance (212 Hz: errors of the worn volume of 1.9, 1.2 and
    0.1 % with 5, 7 and 9)."""
    periods_in_contact: float = 0.5
    """Shortest contact that the harmonics resolve, in periods of the highest harmonic."""
    stiffness_mismatch: float = 0.25
    """Largest |1 - E G|: above, structure and penalty answer differently, and more harmonics are needed."""

    # limits of size
    cheap_unknowns: int = 400
    """Most unknowns of a cheap balance: that of a node of a sweep, and those that only resolve a short contact, the
    structure at higher harmonics, or a state by homotopy."""
    most_unknowns: int = 2000
    """Most unknowns of a balance in a history with "auto", and of a balance that is solved to estimate an error.
    Impacts couple all harmonics of a small joint, and no preconditioner helps."""
    displacements_of_limits: int = 36
    """Number of relative displacements to which both limits belong. They grow in proportion for a larger joint: five
    harmonics are cheap for the dovetail of 48 pairs (1584 unknowns), and 27 are the most (7920), as for any mesh."""
    most_samples: int = 2048
    """Most samples of a period that "auto" takes, and samples in the search for a missed event: a sine can exceed a
    limit between them by 1e-6 only. The exact references take 512 at rtol 1e-3. Nine pairs of a blade that lift off at
    2000 N: with 8192 the wear rate at the edge of the contact is no more accurate."""

    # estimates and refinement
    safety: float = 1.5
    """Error over the difference to a state two levels up, to a state with more samples, or to the reference solution of
    a history; applied twice to the difference to one level up. The differences alone give 2 to 1.2 for an error as 1/H
    to 1/H^3 two levels up, 2 to 1.3 for an error as the time step or its square with twice the samples. Histories of
    the dovetail, 16 and 48 pairs, all schemes, steps of 250 to 2000 cycles: 0.02 to 1.4, in the median 0.3."""
    level_iterations: int = 40
    """Newton iterations of a solve that starts from the state at another resolution."""
    refinement_work: float = 1.2e6
    """Most Newton iterations of one refinement, times the unknowns two levels up. Failed solves take most of them. A
    joint of 48 pairs with nine harmonics may take 200."""
    kept_fraction: float = 0.5
    """Fraction of rtol: error up to which harmonics are removed, so that the next state does not add them at once."""
    vibration_recheck: float = 0.3
    """Relative change of the vibration after which errors are estimated and harmonics chosen again. Error of the motion
    of the dovetail on the far side of the resonance: 5 % with 1.0, 0.5 % with 0.3."""
    crossing_window: float = 0.5
    """Fraction of the cycle count. Two histories in which an event happens at different counts cross each other. So the
    error is the largest difference from this fraction of the count on (dovetail, 211.25 Hz, steps of 2000 cycles:
    without it the estimate at the crossing is a quarter of the true error). Later differences are not used: an error
    does not depend on the length of the study."""

    @property
    def violation_limits(self) -> dict[str, float]:
        """Limits of the violations of a certificate; response and wear rate have error estimates instead."""
        return {
            "penetration": self.penetration_limit,
            "tension": self.tension_limit,
            "cone_violation": self.violation_limit,
            "energy_error": self.violation_limit,
            "periodicity_error": self.periodicity_limit,
        }


ACCURACY = AccuracyOptions()
