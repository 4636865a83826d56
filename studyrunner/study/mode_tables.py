"""What a study of nonlinear modes, with axes.modal_amplitude, has no use for: excitation, wear, slow time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from studyrunner.study.study import Study
from studyrunner.user_error import UserError

_NO_AXES = ("frequency", "wear_coefficient", "excitation_amplitude", "step", "scheme")
_NO_TABLES = ("slow_time", "wear")
_IDLE = {"frequency": [1.0]}
_WHY = "leave it out: with axes.modal_amplitude nothing is excited and nothing wears"


def asks_for_modes(sections: Mapping[str, Any]) -> bool:
    """Whether the tables of a study ask for nonlinear modes."""
    return "modal_amplitude" in _table(sections, "axes")


def check_mode_tables(sections: Mapping[str, Any], source: str) -> None:
    """Raises UserError where a key of nonlinear modes and a key of another study stand together.

    sections: tables of the study file. source: the file, as the user named it.
    """
    axes = _table(sections, "axes")
    if not asks_for_modes(sections):
        if "mode" in axes:
            remedy = "give axes.modal_amplitude as well: mode is the number of a nonlinear mode"
            raise UserError(source, "axes.mode", axes["mode"], remedy)
        return
    for name in _NO_AXES:
        if name in axes:
            raise UserError(source, f"axes.{name}", axes[name], _WHY)
    for name in _NO_TABLES:
        for key, value in _table(sections, name).items():
            raise UserError(source, f"{name}.{key}", value, _WHY)
    if _table(sections, "outputs").get("loops"):
        remedy = "leave it out: a study with axes.modal_amplitude keeps no fretting loops"
        raise UserError(source, "outputs.loops", sections["outputs"]["loops"], remedy)
    sweeps = axes.get("sweep", "up")
    if "ramp" in (sweeps if isinstance(sweeps, list | tuple) else [sweeps]):
        remedy = 'give "up" or "down": the modal amplitude is raised or lowered'
        raise UserError(source, "axes.sweep", "ramp", remedy)


def check_worn_counts(study: Study) -> None:
    """Raises UserError where the modes of a worn joint have no cycle count, their coordinate in the result."""
    if study.has_modes and study.scene.worn is not None and all(axis.name != "cycle" for axis in study.scene_axes):
        remedy = "missing: give the cycle count of each depth, which is the coordinate cycle of the modes"
        raise UserError(study.source, "scene.worn.cycle", None, remedy)


def with_idle_keys(sections: Mapping[str, Any]) -> dict[str, Any]:
    """The tables with values of the keys that nonlinear modes have no use for, where a study needs some."""
    if not asks_for_modes(sections):
        return dict(sections)
    return {**sections, "axes": {"mode": 1, **_IDLE, **sections["axes"]}, "slow_time": {"cycles": 0.0}}


def without_idle_keys(sections: Mapping[str, Any]) -> dict[str, Any]:
    """The tables of a checked study without the keys that nonlinear modes have no use for."""
    if sections["axes"]["modal_amplitude"] is None:
        return dict(sections)
    kept = {name: table for name, table in sections.items() if name not in _NO_TABLES}
    return {**kept, "axes": {name: value for name, value in sections["axes"].items() if name not in _NO_AXES}}


def _table(sections: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    table = sections.get(name, {})
    return table if isinstance(table, Mapping) else {}
