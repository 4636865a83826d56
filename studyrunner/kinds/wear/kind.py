"""Wear histories: their variables, and what they read of a study."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from studyrunner.kinds.kind import Kind
from studyrunner.values import Wrong
from studyrunner.variables import Variable

if TYPE_CHECKING:
    from studyrunner.study.study import Study

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
    "dissipated_energy": Variable(
        _PAIRS, "J/m2", "energy that friction has dissipated", "Since cycle 0, on contact_area; see [wear.evolution]."
    ),
    "dissipated_energy_error": Variable(_PAIRS, "J/m2", "estimated error of the dissipated energy"),
    "pair_friction": Variable(_PAIRS, "1", "friction coefficient of the pair", "Changes with [wear.evolution]."),
    "pair_stiffness": Variable(
        _PAIRS, "N/m3", "contact stiffness of the pair", "Of [wear.evolution]; inf without one: that of the scene."
    ),
    "friction_power": Variable(_PAIRS, "W/m2", "power density of friction", "Mean over a period, on contact_area."),
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

OF_EVOLUTION = ("dissipated_energy", "dissipated_energy_error", "pair_friction", "pair_stiffness")
"""Further ones of a study that names none and has [wear.evolution]."""

OF_SAMPLES_ALONE = ("wear_depth_last",)
_SELDOM = (*OF_SAMPLES_ALONE, *FOLLOWED_FREQUENCY, *OF_EVOLUTION, "friction_power")
USUAL = tuple(name for name in ASKED if name not in _SELDOM)
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

ALLOWED = {
    "allowable_amplitude": Variable(
        (),
        "N",
        "excitation amplitude at which the wear meets slow_time.until after the last cycle",
        "The values of the point are those of its history. inf: none that was tried wears so much.",
    ),
    "allowable_amplitude_error": Variable((), "N", "estimated error of allowable_amplitude"),
}
"""Those of a study with axes.excitation_amplitude = "allowable"."""

_SECTORS = ("cycle", "sector")
OF_RINGS = {
    "sector_amplitude": Variable(_SECTORS, "m", "amplitude of the first response of the sector", _MAGNITUDE),
    "sector_phase": Variable(
        _SECTORS,
        "rad",
        "phase of the first response of the sector",
        f"{_ANGLE} At the sector's own time: at one time that of sector s is 2 pi s nodal_diameter / n_sectors more.",
    ),
    "sector_worn_volume": Variable(_SECTORS, "m3", "worn volume of the sector", "Sums up to worn_volume."),
    "sector_wear_depth": Variable(_SECTORS, "m", "largest wear depth of any pair of the sector"),
    "amplitude_magnification": Variable(
        _CYCLE,
        "1",
        "largest sector_amplitude over the mean of all sectors",
        "1 where all sectors vibrate alike. Whitehead's factor is over the peak of a ring of equal sectors instead.",
    ),
}
"""Those of a ring of sectors, `scene.sectors`."""

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
    "slip_amplitude": Variable(
        (),
        "N",
        "excitation amplitude at which the first pair slips in every period, or lifts",
        "Extrapolated from the unworn state. NaN where a pair slips or lifts in it, inf if none ever does.",
    ),
    "message": Variable((), "1", "further facts on how the point ended", dtype="U240"),
}
"""Those that every result of wear histories holds."""


def _broken_rules(study: "Study") -> Iterator[Wrong]:
    """The excitation has a frequency."""
    if not study.axes.model_fields_set & {"frequency", "frequency_ratio"}:
        yield Wrong("axes.frequency", None, "give either it, in Hz, or frequency_ratio")


WEAR = Kind(
    name="wear",
    words="wear histories",
    about="Fretting wear of a joint under vibration: wear histories of the scene {scene}. Wear depths and worn volume,"
    " contact pressures and slip, vibration, and the errors of each.",
    time="to a factor of two, if every point wears; a point whose vibration jumps takes up to five times as long",
    axes=("frequency", "wear_coefficient", "excitation_amplitude", "step", "scheme", "sweep"),
    other_axes=("frequency_ratio",),
    numbers=("frequency", "wear_coefficient", "excitation_amplitude"),
    reads={"slow_time": ("cycles", "final_share", "outputs", "until", "largest_depth")},
    rules=_broken_rules,
    asked=ASKED,
    always=OF_A_HISTORY,
    more=LOOPS | COUNTS | ALLOWED,
    of_rings=OF_RINGS,
    usual=USUAL,
    of_samples=OF_SAMPLES,
    scene=("mesh", "natural_frequency", "exact"),
    counted="cycle",
    follows=True,
)
