"""Tuning constants of the accuracy control: certificate, harmonic levels, error estimates, refinement."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class AccuracyOptions:
    """Limits and safety factors; each with its meaning, unit (none: a ratio) and the evidence for its value.

    What is called measured without a place was measured on the states in the table of `solver.accuracy.certificate`.
    """

    # certificate
    penetration_limit: float = 0.1
    """Of the largest relative motion. Good states: 0.13 at one harmonic of vibro-impact, 0.02 on the dovetail."""
    tension_limit: float = 0.01
    """Of the largest normal force. Good states: below 1e-12."""
    cone_limit: float = 0.05
    """Of the largest friction limit. Good states: below 1e-12; a friction coefficient 10 % too large is found."""
    energy_limit: float = 0.05
    """Of the largest work in a period. Good states: up to 0.01 (vibro-impact)."""
    periodicity_limit: float = 1e-3
    """Of the largest friction limit. Good states: up to 8e-7; slip that does not repeat by 2 % is found."""
    residual_round_off: float = 1e-10
    """Scaled residual: the mean position of a marched mass is held by 1e-5 of its stiffness."""
    points_per_sample: int = 4
    """Points a sample at which series are looked at: the samples themselves would flatter them."""
    noticed_loss_factor: float = 1e-3
    """Loss factor that is too small for any structure to notice."""
    round_off_vibration: float = 1e-6
    """Of the mean: a smaller vibration is round-off."""

    # what happens in a period
    round_off_change: float = 1e-9
    """Change of the tangential state in a period, or even harmonics of the force, over their size: less is round-off
    (1e-12 and below in good states), the pair does not slip and the state is symmetric."""
    asymmetric_force: float = 1e-6
    """Even harmonics over the largest force: a state of odd harmonics that has more takes even ones again."""

    # harmonic levels
    harmonic_levels: tuple[int, ...] = (1, 3, 5, 9, 13, 19, 27, 39, 55, 79, 115, 165, 235, 331, 469)
    """Highest harmonics between which "auto" chooses: all but the last two, with which it compares. Without 7: on the
    dovetail states with five and seven harmonics agree by chance (212 Hz: errors of the worn volume of 1.9, 1.2 and
    0.1 % with 5, 7 and 9)."""
    most_mixed_harmonics: int = 79
    """Highest level of "auto" but for odd harmonics alone: motions that hit something take more in vain."""
    displacements_of_limits: int = 144
    """Relative displacements for which numbers of unknowns are meant here, those of the dovetail of 48 pairs: for a
    larger joint they grow in proportion, so that the harmonics are limited and not the pairs."""
    coarse_unknowns: int = 1600
    """Unknowns that it has then at most: about the dovetail of 48 pairs with five harmonics (1584)."""
    periods_in_contact: float = 0.5
    """Periods of the highest harmonic that the shortest contact takes, from where on harmonics see it."""
    stiffness_mismatch: float = 0.25
    """Of |1 - E G|: where the structure answers otherwise than the penalty, harmonics are missing."""
    octaves_beyond: float = 8.0
    """Octaves above the first harmonic left out up to which that is judged."""

    # states at other levels
    event_samples: int = 2048
    """Samples of a period with which a missed event is looked for: a sine overtops a limit unseen by 1e-6 then."""
    level_iterations: int = 40
    """Newton iterations of a solve from the state of another level."""
    dear_unknowns: int = 1000
    """Unknowns from which a solve is dear: odd harmonics above 79, homotopies and thrice the samples end here."""
    far_unknowns: int = 400
    """Unknowns of a balance that is solved only to see a short contact, or how the structure goes on."""
    compared_unknowns: int = 12000
    """Unknowns of a balance that is solved to estimate an error."""
    two_levels_safety: float = 1.5
    """Error over the difference to two levels up: 2 to 1.2 where the error falls as 1/H to 1/H^3."""
    one_level_safety: float = 2.5
    """Error over the difference to one level up: 3.4 to 1.5 for the same."""
    double_samples_safety: float = 1.5
    """Error over the difference to twice the samples: 2 to 1.3 where it falls with the step in time or its square."""
    triple_samples_safety: float = 2.0
    """The same to three times the samples: 1.5 to 1.1, but those of single events scatter."""
    small_slip_work: float = 1e-3
    """Of the work of the excitation: where normal force times slip is less, it is judged against this."""
    no_slip_work: float = 1e-3
    """Of the small slip work: where even that is not reached, nothing wears."""
    creep_fraction: float = 0.1
    """Of rtol: fraction of the slip work that may be creep."""
    small_peak: float = 0.01
    """Of the largest peak: responses that move less are judged against this."""
    small_response: float = 1e-5
    """Of what the excitation would cause on the stiffness of the joint alone: less says nothing."""
    kept_fraction: float = 0.5
    """Of rtol: error up to which harmonics are left out again, so that the next state does not add them at once."""
    spare_fraction: float = 0.3
    """Of the kept error: a state so accurate is tried with fewer harmonics and samples."""
    faint_force: float = 0.1
    """Of rtol, over the largest normal force: contacts with less force need not be resolved."""

    # refinement
    most_samples: int = 8192
    """Samples of a period, of "auto"."""
    samples_of_unknowns: int = 512
    """Samples of a period where the unknowns are as many as may be, and more where they are fewer. Nine pairs of a
    blade that lift off at 2000 N: 27 harmonics take 8192 samples without it, 0.2 s an iteration, and the wear rate of
    what slips at the edge of the contact is as unknown as with 2048."""
    refinement_work: float = 1.2e6
    """Newton iterations of one refinement times the unknowns two levels up: solves that fail take most of them. A joint
    of 48 pairs with nine harmonics may take 200."""
    most_unknowns: int = 8000
    """Unknowns of a balance that "auto" may march with."""
    small_joint: int = 40
    """Relative displacements up to which a joint is small."""
    few_pairs_unknowns: int = 2000
    """As `most_unknowns`, of a small joint: impacts couple all harmonics, and no preconditioner helps."""
    error_ratio: float = 3.0
    """Of two errors (harmonics, samples): one that is smaller by more is left as it is."""
    vibration_recheck: float = 0.3
    """Relative change of the vibration after which errors are estimated, and harmonics chosen, again. Dovetail: with
    1.0 the motion on the far side of the resonance is 5 % off, with 0.3 it is 0.5 %."""

    # wear histories
    history_safety: float = 1.5
    """Error of a history over its difference to the reference solution. Dovetail, 16 and 48 pairs, all schemes, steps
    of 250 to 2000 cycles: 0.02 to 1.4, in the median 0.3."""
    crossing_window: float = 0.5
    """Of the cycle count: histories that differ by when something happens cross each other. The difference that counts
    is the largest one since this fraction of the count (dovetail, 211.25 Hz, steps of 2000 cycles: without it a quarter
    of the true error at the crossing). What comes later has no part in it, so that an error does not depend on how far
    a study goes."""

    @property
    def violation_limits(self) -> dict[str, float]:
        """Largest accepted violations of a certificate; response and wear rate have estimates of their own."""
        return {
            "penetration": self.penetration_limit,
            "tension": self.tension_limit,
            "cone_violation": self.cone_limit,
            "energy_error": self.energy_limit,
            "periodicity_error": self.periodicity_limit,
        }


ACCURACY = AccuracyOptions()
