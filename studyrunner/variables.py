"""The variables of result files of wear, nonlinear modes and missions: names, dimensions after the axes, unit, meaning.

Of modes the axes end with modal_amplitude and cycle. Of missions slow time is counted in missions, and some values are
those of single blocks.
"""

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Variable:
    """One variable of the result: its dimensions after the axes, its unit and what it means.

    dtype: of numpy. Floating numbers are NaN where there is no result, whole ones 0. flags: what the values 0, 1, ...
    mean, one word each. content: what ACDD calls its type. comment: what a reader would ask next.
    """

    dimensions: tuple[str, ...]
    units: str
    long_name: str
    comment: str = ""
    dtype: str = "float64"
    flags: tuple[str, ...] = ()
    content: str = "modelResult"

    @property
    def is_text(self) -> bool:
        """Whether the values are texts."""
        return self.dtype.startswith(("U", "str"))


_CYCLE, _PAIRS, _RESPONSES = ("cycle",), ("cycle", "contact"), ("cycle", "response")
_ANGLE = "Angle of X. The first harmonic is x(t) = Re(X exp(i omega t))."
_MAGNITUDE = f"{_ANGLE.replace('Angle', 'Magnitude')} A response with a unit in its name, as root stress [MPa], has it."
_NO_TARGET = "NaN where there is no target, or where the target is not reached: see message."
_ITS_HISTORY = "Of the history that the point is read from, which points may share."

ASKED = {
    "worn_volume": Variable(_CYCLE, "m3", "worn volume", "Sum over contact pairs of depth times area."),
    "wear_rate": Variable(_CYCLE, "m3 per cycle", "volume worn in a cycle", "See [wear] in the study."),
    "wear_depth": Variable(_PAIRS, "m", "wear depth", "Of both surfaces of the pair together."),
    "wear_depth_max": Variable(_CYCLE, "m", "largest wear depth of any pair"),
    "wear_depth_max_error": Variable(_CYCLE, "m", "estimated error of the wear depth of the deepest pair"),
    "wear_depth_last": Variable(("contact",), "m", "wear depth at the last count that the point has reached"),
    "mean_pressure": Variable(
        _PAIRS, "Pa", "mean contact pressure over a period", "Force over contact_area; compression."
    ),
    "response_amplitude": Variable(_RESPONSES, "m", "amplitude of the first harmonic of the response", _MAGNITUDE),
    "response_phase": Variable(_RESPONSES, "rad", "phase of the first harmonic of the response", _ANGLE),
    "response_mean": Variable(_RESPONSES, "m", "mean of the response over a period", "Of static load and wear."),
    "response_peak": Variable(_RESPONSES, "m", "largest magnitude of the response over a period", "With its mean."),
    "excitation_frequency": Variable(
        _CYCLE, "Hz", "frequency of the excitation", "Changes where it follows a resonance."
    ),
    "excitation_frequency_error": Variable(
        _CYCLE, "Hz", "estimated error of excitation_frequency", "0 for a given frequency."
    ),
    "slip_range": Variable(_PAIRS, "m", "range of the slip over a period", "Largest distance of two places."),
    "open_fraction": Variable(_PAIRS, "1", "fraction of the period in which the pair is open"),
    "friction_use": Variable(
        _CYCLE, "1", "largest friction force over its limit", "Of any pair, at any time; 1 where one slips."
    ),
    "residual": Variable(_CYCLE, "1", "scaled residual of the harmonic balance"),
    "penetration": Variable(_CYCLE, "1", "largest penetration over the largest relative motion"),
    "tension": Variable(_CYCLE, "1", "largest tension over the largest normal force"),
    "cone_violation": Variable(_CYCLE, "1", "largest tangential force above its limit, over the largest limit"),
    "energy_error": Variable(_CYCLE, "1", "imbalance of energy in a period over the work of the excitation"),
    "response_error": Variable(
        _CYCLE,
        "1",
        "estimated relative error of the response",
        "1.5 times the largest difference to the reference solution in the second half of the way to the count,"
        " at least the error of harmonics and samples.",
    ),
    "wear_rate_error": Variable(_CYCLE, "1", "estimated relative error of the wear rate", "As response_error."),
    "worn_volume_error": Variable(
        _CYCLE, "1", "estimated relative error of the worn volume", "0 where nothing has worn."
    ),
    "wear_depth_error": Variable(
        _PAIRS, "m", "estimated error of the wear depth", "Relatively larger than for the volume."
    ),
    "harmonics_used": Variable(_CYCLE, "1", "harmonics above the static one in the state", dtype="int32"),
    "samples_used": Variable(_CYCLE, "1", "time samples in a period of the state", dtype="int32"),
}
"""Those that `outputs.variables` asks for, in the order of the file."""

OF_SAMPLES = (
    *("worn_volume", "wear_rate", "wear_depth_max", "wear_depth_max_error", "wear_depth_last"),
    *("response_amplitude", "response_peak", "worn_volume_error"),
)
"""Those of a study with [scatter] that names none: what statistics and pictures need, as there are many points."""

FOLLOWED_FREQUENCY = ("excitation_frequency", "excitation_frequency_error")
"""Further ones of a study that names none and whose frequency follows the resonance."""

_OF_SAMPLES_ALONE = ("wear_depth_max", "wear_depth_max_error", "wear_depth_last")
USUAL = tuple(name for name in ASKED if name not in (*_OF_SAMPLES_ALONE, *FOLLOWED_FREQUENCY))
"""Those of other studies that name none."""

LOOPS = {
    name: Variable(
        ("cycle", "contact", "phase", "component"),
        units,
        f"{meaning} through a period, positive {sign}",
        "In the frame of the pair; NaN, without room on the disk, for pairs that outputs.loops does not name.",
    )
    for name, units, meaning, sign in (
        ("loop_displacement", "m", "relative displacement", "where it closes"),
        ("loop_force", "N", "contact force", "in compression"),
    )
}
"""Those of the pairs that `outputs.loops` asks for; of the other pairs they are NaN and take no room."""

COUNTS = {"cycle_count": Variable(_CYCLE, "1", "number of vibration cycles of the output", "inf: the final state.")}
"""That of a study to the end, slow_time.cycles = inf, whose coordinate cycle is the number of the output."""

OWN_STEPS = ("adaptive", "final")
"""Schemes that choose their steps, without `step`: for another wear coefficient the same ones at other counts."""

LOOP_PHASES = 128
"""Phases of a loop, equally spaced over a period from 0: those that the solver has."""

LOOP_COMPONENTS = ("normal", "tangent_1", "tangent_2")
"""Components of a loop."""

CERTIFICATE = {
    "residual": "scaled residual",
    "penetration": "penetration over the largest motion",
    "tension": "tension over the largest normal force",
    "cone_violation": "friction above its limit, over the largest limit",
    "energy_error": "imbalance of energy over the work of the excitation",
    "response_error": "estimated relative error of the response",
    "wear_rate_error": "estimated relative error of the wear rate",
}
"""Those of them that say how right a state is, none of them negative and 0 the best: what a short table calls them."""

OF_A_HISTORY = {
    "outcome": Variable(
        (), "1", "how the computation of the point ended", "See the attribute sentences.", dtype="int8"
    ),
    "jump_cycle": Variable((), "1", "first cycle count at which the solution branch was lost", "NaN if it never was."),
    "cycles_to_target": Variable((), "1", "cycle count at which slow_time.until was reached", _NO_TARGET),
    "cycles_to_target_error": Variable((), "1", "estimated error of cycles_to_target, cycles"),
    "newton_iterations": Variable((), "1", "Newton iterations of the point", _ITS_HISTORY, dtype="int32"),
    "run_time": Variable((), "s", "CPU time of the computing thread", f"{_ITS_HISTORY} Differs from run to run."),
    "error_estimate": Variable((), "1", "estimated relative error of the last worn volume", "NaN: not estimated."),
    "last_cycle": Variable(
        (),
        "1",
        "cycle count up to which the point was computed",
        "Later values are NaN, or 0 in whole numbers. NaN where there is no state at all. A point ends, as"
        " converged, with the step that reaches slow_time.until.",
    ),
    "largest_wear_depth": Variable((), "m", "largest wear depth of any pair at any count"),
    "branch": Variable((), "1", "number of folds that the sweep has jumped over since it began", dtype="int32"),
    "fold_frequency": Variable((), "Hz", "last fold at which the sweep left its solution branch", "NaN where none."),
    "step_limit": Variable((), "1", "largest stable explicit step at cycle 0, predicted, cycles", "inf where none."),
    "message": Variable((), "1", "further facts on how the point ended", dtype="U240"),
}
"""Those that every result of wear histories holds."""

OF_MODES = {
    "natural_frequency": Variable((), "Hz", "natural frequency of the nonlinear mode"),
    "natural_frequency_error": Variable((), "Hz", "estimated error of the natural frequency", "inf: unknown."),
    "damping_ratio": Variable((), "1", "damping ratio of the nonlinear mode", "Of friction and structure together."),
    "damping_ratio_error": Variable((), "1", "estimated error of the damping ratio", "inf: unknown."),
    "response_amplitude": Variable(
        ("response",),
        "m",
        "amplitude of the first harmonic of the response in the mode",
        "At the modal amplitude; over modal_amplitude: shape of the mode, normalised with the mass.",
    ),
    "response_phase": Variable(
        ("response",),
        "rad",
        "phase of the first harmonic of the response in the mode",
        "To the vibration of the linear mode, of which the largest component has the phase 0.",
    ),
    "slip_fraction": Variable(("contact",), "1", "fraction of the period in which the pair slips"),
    "open_fraction": replace(ASKED["open_fraction"], dimensions=("contact",)),
    "harmonics_used": replace(ASKED["harmonics_used"], dimensions=()),
    "samples_used": replace(ASKED["samples_used"], dimensions=()),
}
"""Those that `outputs.variables` asks for in a study of nonlinear modes, in the order of the file."""

OF_A_MODE_POINT = {
    "outcome": OF_A_HISTORY["outcome"],
    "newton_iterations": replace(
        OF_A_HISTORY["newton_iterations"], comment="With the whole way from the joint at rest."
    ),
    "run_time": replace(
        OF_A_HISTORY["run_time"], comment="With the way from the point before; differs from run to run."
    ),
    "message": OF_A_HISTORY["message"],
}
"""Those that every result of nonlinear modes holds."""

_OF_ONE = "Of the mission that ends at the number; at 0 of the first mission."
_BLOCK, _BLOCKS = ("block",), ("mission", "block")


def _by_mission(name: str) -> Variable:
    """A variable of wear histories with missions in place of cycles."""
    entry = (ASKED | OF_A_HISTORY)[name]
    long_name, comment = (
        text.replace("cycle count", "number of missions").replace("cycles", "missions")
        for text in (entry.long_name, entry.comment)
    )
    dimensions = tuple("mission" if each == "cycle" else each for each in entry.dimensions)
    return replace(entry, dimensions=dimensions, long_name=long_name, comment=comment)


def _of_block(name: str, when: str = "end") -> Variable:
    """A variable of wear histories at the end, or at the beginning, of a block."""
    entry, long_name = ASKED[name], f"{ASKED[name].long_name} at the {when} of a block"
    if entry.units == "Hz":
        return Variable(_BLOCK, "Hz", long_name)
    return replace(entry, dimensions=(*_BLOCKS, "response"), long_name=long_name, comment=_OF_ONE)


OF_MISSIONS = {
    "worn_volume": replace(_by_mission("worn_volume"), comment="Of all blocks, see block_worn_volume."),
    "wear_rate": Variable(("mission",), "m3 per mission", "volume worn in a mission", _OF_ONE),
    "wear_depth": _by_mission("wear_depth"),
    "wear_depth_max": _by_mission("wear_depth_max"),
    "wear_depth_max_error": _by_mission("wear_depth_max_error"),
    "wear_depth_last": ASKED["wear_depth_last"],
    "block_worn_volume": Variable(_BLOCKS, "m3", "worn volume by block", "The blocks add up to worn_volume."),
    "block_worn_volume_error": Variable(
        _BLOCKS, "1", "estimated relative error by block", "0 where a block wears nothing."
    ),
    "block_share": Variable(_BLOCKS, "1", "share of a block in the wear of a mission", f"{_OF_ONE} NaN: no wear."),
    "response_amplitude": _of_block("response_amplitude"),
    "response_phase": _of_block("response_phase"),
    "response_amplitude_begin": _of_block("response_amplitude", "beginning"),
    "response_peak": _of_block("response_peak"),
    "response_peak_begin": _of_block("response_peak", "beginning"),
    "response_error": Variable(_BLOCKS, "1", "estimated relative error of the responses of a block"),
    "excitation_frequency": _of_block("excitation_frequency"),
    "excitation_frequency_begin": _of_block("excitation_frequency", "beginning"),
    "block_cycles": Variable(_BLOCK, "1", "vibration cycles of a block in one mission"),
    "sweep_rate": Variable(
        _BLOCK,
        "1",
        "sweep rate of a passage over (zeta f)^2, of the damping ratio zeta of the joint at rest",
        "A passage far below 1 wears as its steady states do; 0 for steady vibration and where nothing wears.",
    ),
    "worn_volume_error": _by_mission("worn_volume_error"),
    "wear_depth_error": _by_mission("wear_depth_error"),
}
"""Those that `outputs.variables` asks for in a study of missions, in the order of the file."""

OF_MISSIONS_BY_DEFAULT = tuple(name for name in OF_MISSIONS if name not in _OF_SAMPLES_ALONE)
"""Those of a study of missions that names none."""

OF_SAMPLED_MISSIONS = tuple(name for name in OF_MISSIONS if name not in ("wear_depth", "wear_depth_error"))
"""Those of a study of missions with [scatter] that names none."""

OF_A_MISSION = {
    "outcome": OF_A_HISTORY["outcome"],
    "missions_to_target": _by_mission("cycles_to_target"),
    "missions_to_target_error": _by_mission("cycles_to_target_error"),
    "newton_iterations": replace(OF_A_HISTORY["newton_iterations"], comment="Of all blocks."),
    "run_time": replace(OF_A_HISTORY["run_time"], comment="Of all blocks; differs from run to run."),
    "error_estimate": OF_A_HISTORY["error_estimate"],
    "last_mission": _by_mission("last_cycle"),
    "largest_wear_depth": OF_A_HISTORY["largest_wear_depth"],
    "message": OF_A_HISTORY["message"],
}
"""Those that every result of missions holds."""

IN_FILES = {
    "cycle": ASKED | OF_A_HISTORY | LOOPS | COUNTS,
    "modal_amplitude": OF_MODES | OF_A_MODE_POINT,
    "mission": OF_MISSIONS | OF_A_MISSION,
}
"""All that tasks compute, by a dimension that the files of each kind of study alone have."""
