"""Nonlinear modes: their variables, and what they read of a study."""

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from studyrunner.kinds.kind import Kind
from studyrunner.kinds.wear.kind import ASKED, OF_A_HISTORY, OF_RINGS
from studyrunner.values import Wrong
from studyrunner.variables import Variable

if TYPE_CHECKING:
    from studyrunner.study.study import Study

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


def _broken_rules(study: "Study") -> Iterator[Wrong]:
    """The amplitude goes up or down; each worn joint has a cycle count."""
    if "ramp" in study.axes.sweep:
        yield Wrong("axes.sweep", "ramp", 'give "up" or "down": the modal amplitude is raised or lowered')
    if study.scene.worn is not None and not any(axis.is_worn for axis in study.scene_axes):
        remedy = "missing: give the cycle count of each depth, the coordinate of the modes"
        yield Wrong("scene.worn.cycle", None, remedy)


_SWEEP = "up: the modal amplitude is raised from zero; down: raised to a larger one, then lowered."
MODES = Kind(
    name="modes",
    words="nonlinear modes",
    about="Nonlinear modes of a joint: natural frequency and damping over the amplitude, scene {scene}.",
    time="to a factor of three; a mode that is lost at a large amplitude takes longer",
    marker="axes.modal_amplitude",
    axes=("mode", "sweep"),
    last_axes=("modal_amplitude",),
    no_columns=("mode", "modal_amplitude"),
    reads={"slow_time": (), "wear": ("evolution",), "outputs": ("variables", "scene")},
    why="leave it out: with axes.modal_amplitude nothing is excited and nothing wears",
    rules=_broken_rules,
    asked=OF_MODES,
    always=OF_A_MODE_POINT,
    of_rings={
        name: replace(OF_RINGS[name], dimensions=OF_RINGS[name].dimensions[1:])
        for name in ("sector_amplitude", "sector_phase", "amplitude_magnification")
    },
    usual=(*OF_MODES,),
    of_samples=(*OF_MODES,),
    coordinates={"sweep": Variable((), "1", "how the amplitude is reached", _SWEEP)},
)
