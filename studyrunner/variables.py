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
        return self.dtype.startswith(("U", "str"))


_CYCLE, _PAIRS, _RESPONSES = ("cycle",), ("cycle", "contact"), ("cycle", "response")
_FIRST_HARMONIC = "The first harmonic is x(t) = Re(X exp(i omega t))."
_OWN = "A response with a unit in its name, as root stress [MPa], has this unit."
_NO_TARGET = "NaN where there is no target, or where the target is not reached: see message."
_ITS_HISTORY = "Of the history that the point is read from, which points may share."

ASKED = {
    "worn_volume": Variable(_CYCLE, "m3", "worn volume", comment="Sum over contact pairs of depth times area."),
    "wear_rate": Variable(_CYCLE, "m3 per cycle", "volume worn in a cycle", comment="See [wear] in the study."),
    "wear_depth": Variable(_PAIRS, "m", "wear depth", comment="Of both surfaces of the pair together."),
    "wear_depth_max": Variable(_CYCLE, "m", "largest wear depth of any pair"),
    "wear_depth_max_error": Variable(_CYCLE, "m", "estimated error of the wear depth of the deepest pair"),
    "wear_depth_last": Variable(("contact",), "m", "wear depth at the last count that the point has reached"),
    "mean_pressure": Variable(
        _PAIRS, "Pa", "contact pressure, mean over a period", comment="Force over contact_area, compression positive."
    ),
    "response_amplitude": Variable(
        _RESPONSES,
        "m",
        "amplitude of the first harmonic of the response",
        comment=f"Magnitude of X. {_FIRST_HARMONIC} {_OWN}",
    ),
    "response_phase": Variable(
        _RESPONSES, "rad", "phase of the first harmonic of the response", comment=f"Angle of X. {_FIRST_HARMONIC}"
    ),
    "response_mean": Variable(
        _RESPONSES, "m", "mean of the response over a period", comment="Of the static load, and what the wear changes."
    ),
    "response_peak": Variable(
        _RESPONSES, "m", "largest magnitude of the response over a period", comment="With the static displacement."
    ),
    "excitation_frequency": Variable(
        _CYCLE, "Hz", "frequency of the excitation", comment='Differs between counts with axes.frequency = "resonance".'
    ),
    "excitation_frequency_error": Variable(
        _CYCLE, "Hz", "estimated error of the frequency of the excitation", comment="0 for a given frequency."
    ),
    "slip_range": Variable(
        _PAIRS, "m", "range of the slip over a period", comment="Largest distance between two places of the slip."
    ),
    "open_fraction": Variable(_PAIRS, "1", "fraction of the period in which the pair is open"),
    "residual": Variable(_CYCLE, "1", "scaled residual of the harmonic balance"),
    "penetration": Variable(_CYCLE, "1", "largest penetration over the largest relative motion"),
    "tension": Variable(_CYCLE, "1", "largest tension over the largest normal force"),
    "cone_violation": Variable(
        _CYCLE, "1", "largest tangential force above its friction limit, over the largest friction limit"
    ),
    "energy_error": Variable(
        _CYCLE, "1", "imbalance of energy in a period over the work of the excitation, or of the contact if less"
    ),
    "response_error": Variable(
        _CYCLE,
        "1",
        "estimated relative error of the response",
        comment="1.5 times the largest difference to the reference solution in the second half of the way to the count,"
        " at least the error of harmonics and samples.",
    ),
    "wear_rate_error": Variable(
        _CYCLE, "1", "estimated relative error of the wear rate", comment="Estimated as response_error."
    ),
    "worn_volume_error": Variable(
        _CYCLE,
        "1",
        "estimated relative error of the worn volume",
        comment="By steps, harmonics, samples and start state; 0 where nothing has worn.",
    ),
    "wear_depth_error": Variable(
        _PAIRS, "m", "estimated error of the wear depth", comment="Relatively larger than that of the worn volume."
    ),
    "harmonics_used": Variable(_CYCLE, "1", "harmonics above the static one in the state", "int32"),
    "samples_used": Variable(_CYCLE, "1", "time samples in a period of the state", "int32"),
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
        comment="In the frame of the pair; NaN, without room on the disk, for pairs that outputs.loops does not name.",
    )
    for name, units, meaning, sign in (
        ("loop_displacement", "m", "relative displacement", "where it closes"),
        ("loop_force", "N", "contact force", "in compression"),
    )
}
"""Those of the pairs that `outputs.loops` asks for; of the other pairs they are NaN and take no room."""

COUNTS = {
    "cycle_count": Variable(
        _CYCLE, "1", "number of vibration cycles of the output", comment="inf: a final state found without slow time."
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
    "jump_cycle": Variable(
        (), "1", "first cycle count at which the solution branch was lost", comment="NaN if it never was."
    ),
    "cycles_to_target": Variable((), "1", "cycle count at which slow_time.until was reached", comment=_NO_TARGET),
    "cycles_to_target_error": Variable((), "1", "estimated error of cycles_to_target, cycles"),
    "newton_iterations": Variable((), "1", "Newton iterations of the point", "int32", comment=_ITS_HISTORY),
    "run_time": Variable(
        (), "s", "CPU time of the computing thread", comment=f"{_ITS_HISTORY} Differs from run to run."
    ),
    "error_estimate": Variable(
        (), "1", "estimated relative error of the last worn volume", comment="NaN where it was not estimated."
    ),
    "last_cycle": Variable(
        (),
        "1",
        "cycle count up to which the point was computed",
        comment="Later values are NaN, or 0 in whole numbers. NaN where there is no state at all. A point ends, as"
        " converged, with the step that reaches slow_time.until.",
    ),
    "largest_wear_depth": Variable((), "m", "largest wear depth of any pair at any count"),
    "branch": Variable((), "1", "number of folds that the sweep has jumped over since it began", "int32"),
    "fold_frequency": Variable(
        (), "Hz", "fold at which the sweep left its solution branch before this frequency", comment="NaN where none."
    ),
    "step_limit": Variable(
        (), "1", "predicted largest stable step of the explicit scheme at cycle 0, cycles", comment="inf where none."
    ),
    "message": Variable((), "1", "further facts on how the point ended", "U240"),
}
"""Those that every result holds."""
