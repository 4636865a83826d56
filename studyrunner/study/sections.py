"""The tables of a study file: their keys, what each key takes, and its default."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Final

from pydantic import BaseModel, BeforeValidator, Field, SerializeAsAny, TypeAdapter

from solver.settings import TARGETS
from studies.contact_compliance import ContactStiffness
from studies.fe_models.model_files import ModelFiles
from studyrunner.coordinates import SCENE
from studyrunner.mission_variables import OF_MISSIONS
from studyrunner.mode_variables import OF_MODES
from studyrunner.study.similar_names import nearest_name
from studyrunner.study.values import (
    Axis,
    Cycles,
    Fraction,
    Harmonics,
    Mode,
    NotNegative,
    Positive,
    Samples,
    Scheme,
    Section,
    Sweep,
    Switch,
    Text,
    once,
    read,
    whole,
)
from studyrunner.study.worn import Worn
from studyrunner.user_error import WrongValueError
from studyrunner.variables import ASKED, KEPT, USUAL

AUTO: Final = "auto"
"""In place of a number of harmonics or samples: as many as each state needs for `rtol`."""

SOLVER_AXES = ("harmonics", "samples", "tolerance", "rtol")
AXES = ("frequency", "wear_coefficient", "excitation_amplitude", "step", "scheme", "sweep")
AXES_OF_MODES = ("mode", "sweep")
"""Axes of a study of nonlinear modes, beside modal_amplitude."""
AXES_OF_MISSIONS = ("frequency", "wear_coefficient", "excitation_amplitude", "sweep")
"""Axes of a study of missions; those that every block gives a value of its own are none."""

_MISSIONS = whole(1, 10_000_000)
_N_OUTPUTS = TypeAdapter(Annotated[int, whole(1, 1_000_000)])
_COUNT = TypeAdapter(NotNegative)
_TARGET = TypeAdapter(Positive)
_PAIR = TypeAdapter(Annotated[int, whole(0, 1_000_000)])

DEFAULT: Final = "default"
"""In a list of variables: those that cost little, which is what a study without such a list asks for."""


def _read_name(value: object) -> str:
    if not isinstance(value, str) or not value.strip() or value.startswith(".") or not value.isprintable():
        raise WrongValueError(value, "give a name that can be a file name")
    if "/" in value or "\\" in value or len(value) > 100:
        raise WrongValueError(value, "give a name of at most 100 characters without a slash")
    return value


def _read_outputs(value: object) -> int | tuple[float, ...]:
    if not isinstance(value, list | tuple):
        n_outputs: int = read(_N_OUTPUTS, value)
        return n_outputs
    counts = tuple(read(_COUNT, item) for item in value)
    if not counts or any(later <= earlier for earlier, later in pairwise(counts)):
        raise WrongValueError(value, "give a number of outputs or an ascending list of cycle counts")
    return counts


def _read_variables(value: object) -> tuple[str, ...]:
    if not isinstance(value, list | tuple):
        raise WrongValueError(value, "give a list of names of result variables")
    names_of_all = tuple(dict.fromkeys((*ASKED, *SCENE, *OF_MODES, *OF_MISSIONS)))
    known = (*names_of_all, *KEPT)
    for name in value:
        if name != DEFAULT and name not in known:
            raise WrongValueError(name, f'give "{DEFAULT}" or {_similar(str(name), known)}')
    names = once(value)
    return tuple(name for name in names_of_all if name in names)


def _similar(name: str, known: Sequence[str]) -> str:
    """Variables whose names hold this one, else the most similar one, else all."""
    holding = [each for each in known if name and name in each]
    return f"one of {', '.join(holding)}" if holding else nearest_name(name, known)


def _read_loops(value: object) -> tuple[int, ...]:
    if not isinstance(value, list | tuple):
        raise WrongValueError(value, "give a list of contact indices")
    return tuple(sorted(once(read(_PAIR, item) for item in value)))


def _read_target(value: object) -> dict[str, float]:
    if not isinstance(value, dict) or len(value) != 1 or next(iter(value)) not in TARGETS:
        raise WrongValueError(value, "give one of " + ", ".join(f"{{{name} = ...}}" for name in TARGETS))
    return {name: read(_TARGET, item) for name, item in value.items()}


class StudySection(Section):
    """[study]: name and title of the study."""

    name: Annotated[str, BeforeValidator(_read_name)] = Field(description="name of the study and of its result file")
    title: Text = Field("", description="goes into the result")


class AxesSection(Section):
    """[axes]: every axis becomes a dimension of the result, in the order of the values given here."""

    frequency: Axis[Positive] = Field(
        description='Hz; a number, a list or {start, stop, num}; or "resonance" or "peak", see [loading]'
    )
    wear_coefficient: Axis[NotNegative] = Field((1.1e-11,), description="1/Pa")
    excitation_amplitude: Axis[Positive] = Field((1.0,), description="N, multiplies the scene's unit harmonic load")
    step: Axis[Positive] = Field((1000.0,), description="h, cycles; the adaptive scheme chooses its own")
    scheme: Axis[Scheme] = Field(("adaptive",), description="of the wear steps")
    sweep: Axis[Sweep] = Field(
        ("up",), description="how the unworn state is reached: along the frequency, or by raising the excitation"
    )
    modal_amplitude: Axis[Positive] | None = Field(
        None, description="m sqrt(kg), of nonlinear modes, in place of frequency and excitation"
    )
    mode: Axis[Mode] | None = Field(None, description="number of the nonlinear mode, by frequency, from 1 on")
    harmonics: Axis[Harmonics] | None = Field(None, description="harmonics above the static one")
    samples: Axis[Samples] | None = Field(None, description="time samples in a period")
    tolerance: Axis[Fraction] | None = Field(None, description="of the scaled residual")
    rtol: Axis[Fraction] | None = Field(
        None, description="relative error that automatic settings and adaptive steps aim at"
    )


class SlowTimeSection(Section):
    """[slow_time]: end of the histories, and cycle counts of the output."""

    cycles: Cycles = Field(
        100_000.0, description="cycles; 0 for the unworn states only, inf: until nothing wears any more"
    )
    missions: Annotated[int, _MISSIONS] | None = Field(
        None, description="how often the blocks under [[mission]] are flown, in place of cycles"
    )
    final_share: Fraction = Field(
        1e-4, description="of the largest wear rate of each pair: below it nothing wears any more, with cycles = inf"
    )
    outputs: Annotated[int | tuple[float, ...], BeforeValidator(_read_outputs)] = Field(
        101,
        description="number of equally spaced cycle counts, 0 and the last included, or a list of cycle counts; with"
        " cycles = inf their number, spaced evenly in worn volume and cycles",
    )
    until: Annotated[dict[str, float] | None, BeforeValidator(_read_target)] = Field(
        None,
        description="wear at which a point ends, {wear_depth = m of the deepest pair}, {worn_volume = m3}, or"
        " {frequency_shift = relative change of the resonance of the vibration}",
    )
    largest_depth: Positive | None = Field(
        None, description="m; the explicit scheme then wears no pair deeper than this in a step, Eq. (22), for any h"
    )


class SolverSection(Section):
    """[solver]: resolution and accuracy. A key under [axes] replaces the key here."""

    harmonics: Harmonics = Field(AUTO, description="harmonics above the static one")
    samples: Samples = Field(AUTO, description="time samples in a period")
    tolerance: Fraction = Field(1e-8, description="of the scaled residual")
    rtol: Fraction = Field(1e-2, description="relative error that automatic settings and adaptive steps aim at")
    shortcuts: Switch = Field(
        True, description="whether points with the same history share one; false: every point is computed on its own"
    )
    time_limit: Positive | None = Field(
        None, description="s, CPU time that a start state or a wear history may take; none unless it is given"
    )


class OutputsSection(Section):
    """[outputs]: variables of the result; `outcome` and the totals of a point are always there."""

    variables: Annotated[tuple[str, ...], BeforeValidator(_read_variables)] = Field(
        USUAL, description="names of result variables"
    )
    loops: Annotated[tuple[int, ...], BeforeValidator(_read_loops)] = Field(
        (), description="indices of the contact pairs whose fretting loops are kept"
    )
    scene: Switch = Field(
        False, description="whether the reduced model of a bundled scene is kept, as that of a scene file always is"
    )


class SceneFileParameters(Section):
    """[scene] of a scene file: the friction coefficient only, if the file has none for each pair."""

    friction_coefficient: NotNegative | None = Field(None, description="a number, 0 or more")
    contact_stiffness: ContactStiffness = None


class SceneSection(Section):
    """[scene]: model, and parameters of this model.

    parameters: checked object of the class of the scene, with `friction_coefficient` at least.
    worn: wear that the joint begins with.
    path: file of the scene; None for a scene that is built.
    group: group of the scene in this file; empty in a scene file.
    files: files of a finite-element model; None for other scenes.
    offers: names in `outputs.variables` that this scene knows and not every scene knows.
    """

    model: Text
    parameters: SerializeAsAny[BaseModel]
    worn: Worn | None = None
    path: Path | None = Field(None, exclude=True)
    group: str = Field("", exclude=True)
    files: ModelFiles | None = Field(None, exclude=True)
    offers: tuple[str, ...] = Field((), exclude=True)

    @property
    def is_bundled(self) -> bool:
        """Whether the scene is a bundled one; a result may hold the model that it was built to."""
        return not (names_file(self.model) or names_model(self.model))


def names_model(model: str) -> bool:
    """Whether the text under `scene.model` names a finite-element model: a deck or a mesh."""
    return Path(model).suffix.lower() in (".inp", ".msh", ".cdb")


def names_file(model: str) -> bool:
    """Whether the text under `scene.model` names a scene file: a path, or a name with an HDF5 ending."""
    return "/" in model or "\\" in model or Path(model).suffix.lower() in (".h5", ".hdf5", ".he5")
