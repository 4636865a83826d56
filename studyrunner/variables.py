"""The variables of a result file: names, dimensions after the axes, units, meaning."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Variable:
    """One variable of the result: its dimensions after the axes, its unit and what it means.

    dtype: of numpy. Floating numbers are NaN where there is no result, whole ones 0. flags: what the values 0, 1, ...
    mean, one word each. content: what ACDD calls its type. comment: what a reader would ask next.
    """

    dimensions: tuple[str, ...]
    units: str
    long_name: str
    dtype: str = "float64"
    flags: tuple[str, ...] = ()
    content: str = "modelResult"
    comment: str = ""

    @property
    def is_text(self) -> bool:
        """Whether the values are texts."""
        return self.dtype.startswith("U")


ASKED = {
    "worn_volume": Variable(
        ("cycle",),
        "m3",
        "worn volume, sum over contact pairs of depth times area",
        comment="Integrated on the slow time scale, Eqs. (21) to (26) of the reference.",
    ),
    "wear_rate": Variable(
        ("cycle",),
        "m3 per cycle",
        "volume worn in a cycle",
        comment="wear_coefficient times the work that wears: with Archard's law, Eq. (2) of the reference, normal force"
        " times sliding; the attribute study says which law, under [wear].",
    ),
    "wear_depth": Variable(
        ("cycle", "contact"), "m", "wear depth", comment="Of both surfaces of the pair together; it opens the pair."
    ),
    "wear_depth_max": Variable(("cycle",), "m", "largest wear depth of any pair"),
    "wear_depth_max_error": Variable(("cycle",), "m", "estimated error of the wear depth of the deepest pair"),
    "wear_depth_last": Variable(
        ("contact",), "m", "wear depth at the last count", comment="At the last count that the point has reached."
    ),
    "mean_pressure": Variable(
        ("cycle", "contact"),
        "Pa",
        "contact pressure, mean over a period",
        comment="Normal contact force over contact_area, positive in compression.",
    ),
    "response_amplitude": Variable(
        ("cycle", "response"),
        "m",
        "amplitude of the first harmonic of the response",
        comment="Magnitude of X where x(t) = Re(X exp(i omega t)) is the first harmonic.",
    ),
    "response_phase": Variable(
        ("cycle", "response"),
        "rad",
        "phase of the first harmonic of the response",
        comment="Angle of X where x(t) = Re(X exp(i omega t)) is the first harmonic; above 0 it leads the excitation.",
    ),
    "response_peak": Variable(
        ("cycle", "response"),
        "m",
        "largest magnitude of the response over a period",
        comment="All harmonics, and the static displacement, together.",
    ),
    "excitation_frequency": Variable(
        ("cycle",),
        "Hz",
        "frequency of the excitation",
        comment='With axes.frequency = "resonance" or "peak" that of each count; else the value of the axis.',
    ),
    "excitation_frequency_error": Variable(
        ("cycle",),
        "Hz",
        "estimated error of the frequency of the excitation",
        comment="By the difference to a coarser history, whose frequency is its own; 0 for a given frequency.",
    ),
    "slip_range": Variable(
        ("cycle", "contact"),
        "m",
        "range of the slip over a period",
        comment="Largest distance between two places of the pair in its tangential plane that it slips to.",
    ),
    "open_fraction": Variable(
        ("cycle", "contact"),
        "1",
        "fraction of the period in which the pair is open",
        comment="0 where the pair never opens, 1 where it is never closed.",
    ),
    "residual": Variable(
        ("cycle",),
        "1",
        "scaled residual of the harmonic balance",
        comment="What the solver had to bring below the tolerance of the study.",
    ),
    "penetration": Variable(
        ("cycle",),
        "1",
        "largest penetration over the largest relative motion",
        comment="Of the series of the motion, also between samples.",
    ),
    "tension": Variable(
        ("cycle",),
        "1",
        "largest tension over the largest normal force",
        comment="Part of the certificate: 0 where Signorini's conditions hold.",
    ),
    "cone_violation": Variable(
        ("cycle",),
        "1",
        "largest excess of a tangential force over its friction limit, over the largest friction limit",
        comment="Part of the certificate: 0 where Coulomb's law holds.",
    ),
    "energy_error": Variable(
        ("cycle",),
        "1",
        "imbalance of energy in a period over the work of the excitation, or of the contact if less",
        comment="Work of the excitation less what damping and friction take.",
    ),
    "response_error": Variable(
        ("cycle",),
        "1",
        "estimated relative error of the response",
        comment="First harmonic and peak, by harmonics, samples, steps and start state; NaN where not estimated.",
    ),
    "wear_rate_error": Variable(
        ("cycle",),
        "1",
        "estimated relative error of the wear rate",
        comment="By harmonics, samples, steps and start state; NaN where it was not estimated.",
    ),
    "worn_volume_error": Variable(
        ("cycle",),
        "1",
        "estimated relative error of the worn volume",
        comment="Steps with their propagation, harmonics, samples and start state; 0 where nothing has worn.",
    ),
    "wear_depth_error": Variable(
        ("cycle", "contact"),
        "m",
        "estimated error of the wear depth",
        comment="Single pairs are known less well than the worn volume of all.",
    ),
    "harmonics_used": Variable(("cycle",), "1", "harmonics above the static one in the state", "int32"),
    "samples_used": Variable(("cycle",), "1", "time samples in a period of the state", "int32"),
    "stable": Variable(
        ("cycle",),
        "1",
        "whether the state is stable",
        "int8",
        ("unstable", "stable"),
        comment="Of the periodic state for small disturbances on the fast time scale.",
    ),
}
"""Those that `outputs.variables` asks for, in the order of the file."""

OF_SAMPLES = (
    "worn_volume",
    "wear_rate",
    "wear_depth_max",
    "wear_depth_max_error",
    "wear_depth_last",
    "response_amplitude",
    "response_peak",
    "worn_volume_error",
)
"""Those of a study with [scatter] that names none: what statistics and pictures need, as there are many points."""

FOLLOWED_FREQUENCY = ("excitation_frequency", "excitation_frequency_error")
"""Further ones of a study that names none and whose frequency follows the resonance."""

USUAL = tuple(
    name
    for name in ASKED
    if not name.startswith(("wear_depth_max", "wear_depth_last")) and name not in FOLLOWED_FREQUENCY
)
"""Those of other studies that name none."""

LOOPS = {
    name: Variable(
        ("cycle", "contact", "phase", "component"),
        units,
        f"{meaning} through a period, positive {sign}",
        comment="In the frame of the pair; NaN for pairs that outputs.loops does not name.",
    )
    for name, units, meaning, sign in (
        ("loop_displacement", "m", "relative displacement", "where it closes"),
        ("loop_force", "N", "contact force", "in compression"),
    )
}
"""Those of the pairs that `outputs.loops` asks for; of the other pairs they are NaN and take no room."""

COUNTS = {
    "cycle_count": Variable(
        ("cycle",),
        "1",
        "number of vibration cycles of the output",
        comment="Of each point its own: its outputs are spaced evenly in worn volume and cycles.",
    )
}
"""That of a study to the end, slow_time.cycles = inf, whose coordinate cycle is the number of the output."""

LOOP_PHASES = 128
"""Phases of a loop, equally spaced over a period from 0: those that the solver has."""

LOOP_COMPONENTS = ("normal", "tangent_1", "tangent_2")
"""Components of a loop."""

CERTIFICATE = {
    "residual": "scaled residual",
    "penetration": "penetration",
    "tension": "tension",
    "cone_violation": "violation of the friction cone",
    "energy_error": "energy balance error",
    "response_error": "estimated error of the response",
    "wear_rate_error": "estimated error of the wear rate",
}
"""Those of them that say how right a state is, none of them negative and 0 the best: what a short table calls them."""

KEPT = {
    "outcome": Variable(
        (),
        "1",
        "how the computation of the point ended",
        "int8",
        comment="The attribute sentences holds a line for each of the flags.",
    ),
    "jump_cycle": Variable((), "1", "first cycle count at which the branch was lost", comment="NaN if never."),
    "cycles_to_target": Variable(
        (),
        "1",
        "cycle count at which slow_time.until was reached",
        comment="The point ends with the step that reaches it. NaN where there is no target, or where it is never"
        " reached: message says how far the wear came.",
    ),
    "cycles_to_target_error": Variable(
        (),
        "1",
        "estimated error of cycles_to_target",
        comment="Cycles; NaN where the target is never reached.",
    ),
    "newton_iterations": Variable(
        (),
        "1",
        "Newton iterations of the point, start state included",
        "int32",
        comment="With the whole sweep to the start state, as for this point alone. Of the march that the point was read"
        " from, where points share one.",
    ),
    "run_time": Variable(
        (),
        "s",
        "CPU time of the computing thread, start state included, compiling left out",
        comment="Of the march that the point was read from, where points share one; differs from run to run.",
    ),
    "error_estimate": Variable(
        (),
        "1",
        "estimated relative error of the last worn volume",
        comment="Of the last count that was reached, see worn_volume_error; NaN where it was not estimated.",
    ),
    "last_cycle": Variable(
        (),
        "1",
        "cycle count up to which the point was computed",
        comment="Values after it are NaN, or 0 where a variable is a whole number; NaN where there is no state at all."
        " A point that reaches slow_time.until ends, as converged, with the step that does so.",
    ),
    "largest_wear_depth": Variable(
        (),
        "m",
        "largest wear depth of any pair at any count",
        comment="The joint is taken as it was designed: small against the width of the contact, wear leaves it so.",
    ),
    "branch": Variable((), "1", "number of folds that the sweep has jumped over since it began", "int32"),
    "fold_frequency": Variable(
        (),
        "Hz",
        "fold at which the sweep left its branch on the way to this frequency",
        comment="NaN where there was none since the frequency before.",
    ),
    "step_limit": Variable(
        (),
        "1",
        "predicted largest stable step of the explicit scheme at cycle 0, cycles",
        comment="Infinite where there is none.",
    ),
    "final_method": Variable(
        (),
        "1",
        "how the scheme final has found the final state",
        "int8",
        ("none", "active_set", "march"),
        comment="none with the other schemes. active_set: without slow time, tested to be what a march comes to;"
        " outputs between the unworn and the final state are NaN, or 0 where a variable is a whole number, and"
        " last_cycle is infinite. march: message says why.",
    ),
    "message": Variable(
        (),
        "1",
        "what the outcome does not say by itself",
        "U240",
        comment="From which cycle on something holds no longer and the error reached; what an unexpected error said.",
    ),
}
"""Those that every result holds."""
