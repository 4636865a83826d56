"""The three kinds of study: histories of wear, nonlinear modes, missions. What each has, and what has no use in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from studyrunner.study.sections import SOLVER_AXES, AxesSection, SlowTimeSection, WearSection
from studyrunner.variables import (
    ASKED,
    KEPT,
    OF_A_MISSION,
    OF_A_MODE_POINT,
    OF_MISSIONS,
    OF_MISSIONS_BY_DEFAULT,
    OF_MODES,
    OF_SAMPLED_MISSIONS,
    OF_SAMPLES,
    USUAL,
    Variable,
)


@dataclass(frozen=True)
class Kind:
    """A kind of study.

    name: what its points are. about: what a result holds, of a {scene}.
    axes: axes of the result that are neither keys of the solver, of [scene] and [wear], nor samples, in their order.
    asked, kept: variables that its points may have, and that its result always holds.
    usual, of_samples: variables where the study names none, and where samples are drawn.
    counted: what the slow time counts; empty where nothing wears.
    unused: keys without a use, by table. why: the remedy where one is given.
    """

    name: str
    about: str
    axes: tuple[str, ...]
    asked: Mapping[str, Variable]
    kept: Mapping[str, Variable]
    usual: tuple[str, ...]
    of_samples: tuple[str, ...]
    counted: str
    unused: Mapping[str, tuple[str, ...]]
    why: str


def _other_axes(*axes: str) -> tuple[str, ...]:
    return tuple(name for name in AxesSection.model_fields if name not in (*axes, *SOLVER_AXES))


_AXES = _other_axes("frequency_ratio", "modal_amplitude", "mode")
_OF_MODES = ("mode", "sweep")
_OF_MISSIONS = tuple(name for name in _AXES if name not in ("step", "scheme"))

NUMBERS = tuple(name for name in _OF_MISSIONS if name != "sweep")
"""Axes that hold numbers of the joint and of its excitation, which may scatter."""

WEAR = Kind(
    "wear histories",
    "Fretting wear of a joint under vibration: wear histories of the scene {scene}. Wear depths and worn volume,"
    " contact pressures and slip, vibration, and the errors of each.",
    _AXES,
    ASKED,
    KEPT,
    USUAL,
    OF_SAMPLES,
    "cycle",
    {},
    "",
)
MODES = Kind(
    "nonlinear modes",
    "Nonlinear modes of a joint: natural frequency and damping over the amplitude, scene {scene}.",
    _OF_MODES,
    OF_MODES,
    OF_A_MODE_POINT,
    tuple(OF_MODES),
    tuple(OF_MODES),
    "",
    {
        "axes": _other_axes(*_OF_MODES, "modal_amplitude"),
        "slow_time": tuple(SlowTimeSection.model_fields),
        "wear": tuple(WearSection.model_fields),
        "outputs": ("loops",),
    },
    "leave it out: with axes.modal_amplitude nothing is excited and nothing wears",
)
MISSIONS = Kind(
    "missions",
    "Fretting wear of a joint over missions: scene {scene}. Worn volume by block, wear depths, vibration, and the"
    " errors of each.",
    _OF_MISSIONS,
    OF_MISSIONS,
    OF_A_MISSION,
    OF_MISSIONS_BY_DEFAULT,
    OF_SAMPLED_MISSIONS,
    "mission",
    {
        "axes": _other_axes(*_OF_MISSIONS),
        "slow_time": ("cycles", "final_share", "largest_depth"),
        "outputs": ("loops",),
    },
    "leave it out: slow_time.missions counts in place of cycles, and missions choose their own steps",
)
