"""The three kinds of study: histories of wear, nonlinear modes, missions. What each has, and what has no use in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from solver.settings import FOLLOWED, FollowedFrequency
from studyrunner.mission_variables import OF_A_MISSION, OF_MISSIONS, OF_MISSIONS_BY_DEFAULT, OF_SAMPLED_MISSIONS
from studyrunner.mode_variables import OF_A_MODE_POINT, OF_MODES
from studyrunner.study.mistakes import Mistakes
from studyrunner.study.sections import SOLVER_AXES, AxesSection, LoadingSection, SlowTimeSection, WearSection
from studyrunner.values import listed
from studyrunner.variables import ASKED, KEPT, OF_SAMPLES, USUAL, Variable

Tables = dict[str, Any]

IDLE_FREQUENCY = 1.0
"""Hz, value of the axis where no point has a frequency from it."""


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
        "axes": (*_other_axes(*_OF_MODES, "modal_amplitude"), *WearSection.AXES),
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


def kind_of(tables: Tables) -> Kind:
    """The kind of study that the tables ask for."""
    return MISSIONS if "mission" in tables else MODES if "modal_amplitude" in tables["axes"] else WEAR


def take_unused(tables: Tables, found: Mistakes) -> None:
    """Takes out of the tables the keys that have no use in a study of this kind, each a mistake."""
    kind, axes, slow_time = kind_of(tables), tables["axes"], tables["slow_time"]
    for name, keys in kind.unused.items():
        for key in [key for key in keys if key in tables[name]]:
            value = tables[name].pop(key)
            if (name, value) != ("outputs", []):
                found.add(f"{name}.{key}", value, kind.why)
    if kind is not MODES and "mode" in axes:
        found.add("axes.mode", axes.pop("mode"), "give axes.modal_amplitude as well: mode is that of a nonlinear mode")
    if kind is MODES and "ramp" in listed(axes.get("sweep")):
        found.add("axes.sweep", axes.pop("sweep"), 'give "up" or "down": the modal amplitude is raised or lowered')
    if kind is MISSIONS:
        remedy, given = "give frequencies in Hz: blocks of a mission follow no resonance", axes.get("frequency")
        if any(isinstance(each, str) for each in listed(given)):
            found.add("axes.frequency", given, remedy)
            axes["frequency"] = IDLE_FREQUENCY
        elif "loading" in tables:
            found.add("loading", tables["loading"], remedy)
        tables.pop("loading", None)
        if "missions" not in slow_time:
            remedy = "missing: give the number of missions, how often the blocks are repeated"
            found.add("slow_time.missions", None, remedy)
    elif "missions" in slow_time:
        remedy = "give blocks under [[mission]], which are repeated so often, or slow_time.cycles in its place"
        found.add("slow_time.missions", slow_time.pop("missions"), remedy)


def take_ratio(tables: Tables, found: Mistakes) -> dict[str, str]:
    """Ratios stand for frequencies until the natural frequencies of the scenes are known (`scene_set.at_ratios`).

    Returns the key of mistakes in the frequencies.
    """
    axes = tables["axes"]
    if "frequency_ratio" not in axes:
        return {}
    if "frequency" in axes:
        found.add("axes.frequency", axes["frequency"], "leave it out, or frequency_ratio: give one of both")
    if "exact" in listed(tables["outputs"].get("variables")):
        remedy = "leave it out: it is of given frequencies, and axes.frequency_ratio gives none"
        found.add("outputs.variables", "exact", remedy)
    if "frequency" in tables.get("scatter", {}):
        remedy = "leave it out: axes.frequency_ratio gives each sample the frequency of its own scene"
        found.add("scatter.frequency", tables["scatter"].pop("frequency"), remedy)
    axes["frequency"] = axes["frequency_ratio"]
    return {"axes.frequency": "axes.frequency_ratio"}


def take_followed(tables: Tables, found: Mistakes) -> FollowedFrequency | None:
    """What the frequency follows, None where it is given; the axis then gets the middle of the range."""
    given = tables["axes"].get("frequency")
    word = next((each for each in listed(given) if each in FOLLOWED), None)
    if word is None:
        # another word is a mistake of its own
        if "loading" in tables and not any(isinstance(each, str) for each in listed(given)):
            remedy = 'leave it out, or give axes.frequency = "resonance" or "peak", which is followed in this range'
            found.add("loading", tables.pop("loading"), remedy)
        return None
    if given not in (word, [word]):
        remedy = f'give "{word}" alone: every point has the frequency that it finds; the other is another study'
        found.add("axes.frequency", given, remedy)
    tables["axes"] = {**tables["axes"], "frequency": IDLE_FREQUENCY}
    tables.setdefault("loading", {})
    try:
        low, high = LoadingSection.model_validate(tables["loading"]).between
    except ValidationError:
        # found with the other tables
        return None
    tables["axes"]["frequency"] = 0.5 * low + 0.5 * high
    return FollowedFrequency(word, low, high)


def with_idle_values(tables: Tables) -> Tables:
    """The tables with values of the keys that are needed and have no use in a study of this kind."""
    kind, axes, slow_time = kind_of(tables), tables["axes"], tables["slow_time"]
    if kind is not WEAR:
        axes = {"frequency": IDLE_FREQUENCY, **axes}
    if kind is MODES:
        axes, slow_time = {"mode": 1, **axes}, {"cycles": 0.0}
    return {**tables, "axes": axes, "slow_time": slow_time}


def without_idle_values(tables: Tables, kind: Kind, idle_axes: tuple[str, ...]) -> Tables:
    """The tables of a checked study without the keys that have no use in it. idle_axes: each block has its own."""
    unused = {**kind.unused, "outputs": (), "axes": (*kind.unused.get("axes", ()), *idle_axes)}
    return {
        name: {key: value for key, value in table.items() if key not in unused.get(name, ())}
        if isinstance(table, dict)
        else table
        for name, table in tables.items()
    }
