"""What a study of missions, with blocks under [[mission]], has no use for, and the study of each of its blocks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from studyrunner.study.mission import OWN_AXES, MissionBlock, engine_frequency
from studyrunner.study.room_for_wear import with_room_for_wear
from studyrunner.study.study import Study
from studyrunner.user_error import UserError

_NO_AXES = ("step", "scheme")
_NO_SLOW_TIME = ("cycles", "final_share", "largest_depth")
_IDLE = {"frequency": [1.0]}

CheckStudy = Callable[[Mapping[str, object]], Study]


def asks_for_missions(sections: Mapping[str, Any]) -> bool:
    """Whether the tables of a study ask for missions."""
    return "mission" in sections


def check_mission_tables(sections: Mapping[str, Any], source: str) -> None:
    """Raises UserError where keys of missions and keys of another study stand together.

    sections: tables of the study file. source: the file, as the user named it.
    """
    axes, slow_time = _table(sections, "axes"), _table(sections, "slow_time")
    if not asks_for_missions(sections):
        if "missions" in slow_time:
            remedy = "give blocks under [[mission]], which are flown so often, or slow_time.cycles in its place"
            raise UserError(source, "slow_time.missions", slow_time["missions"], remedy)
        return
    for name, table, keys, why in (
        ("slow_time", slow_time, ("cycles",), "give one of both: slow_time.missions counts in place of cycles"),
        ("slow_time", slow_time, _NO_SLOW_TIME, "leave it out: missions are flown slow_time.missions times"),
        ("axes", axes, _NO_AXES, "leave it out: missions choose their steps"),
        ("axes", axes, ("modal_amplitude", "mode"), "leave it out: a mission is forced vibration"),
        ("outputs", _table(sections, "outputs"), ("loops",), "leave it out: missions keep no fretting loops"),
    ):
        for key in keys:
            if key in table and table[key] != []:
                raise UserError(source, f"{name}.{key}", table[key], why)
    if "missions" not in slow_time:
        raise UserError(source, "slow_time.missions", None, "missing: give how often the blocks are flown")
    given = axes.get("frequency")
    words = [each for each in (given if isinstance(given, list | tuple) else [given]) if isinstance(each, str)]
    if words or "loading" in sections:
        key, value = ("axes.frequency", given) if words else ("loading", sections["loading"])
        raise UserError(source, key, value, "give frequencies in Hz: blocks of a mission follow no resonance")


def check_used_axes(axes: Sequence[str], blocks: Sequence[MissionBlock], source: str) -> None:
    """Raises UserError where all blocks give values of their own to an axis. axes: that the study file gives."""
    for name in axes:
        if blocks and all(block.gives(name) for block in blocks):
            remedy = f"leave it out: every block under [[mission]] gives its own {name}"
            raise UserError(source, f"axes.{name}", None, remedy)


def with_idle_keys(sections: Mapping[str, Any]) -> dict[str, Any]:
    """The tables with a value of the frequency, which a study needs, where every block has its own."""
    if not asks_for_missions(sections):
        return dict(sections)
    return {**sections, "axes": {**_IDLE, **sections["axes"]}}


def without_idle_keys(sections: Mapping[str, Any], study: Study) -> dict[str, Any]:
    """The tables of a checked study of missions without the keys that have no use, the blocks as the file has them."""
    if not study.has_missions:
        return dict(sections)
    idle = (*_NO_AXES, *study.idle_axes)
    axes = {name: value for name, value in sections["axes"].items() if name not in idle}
    slow_time = {name: value for name, value in sections["slow_time"].items() if name not in _NO_SLOW_TIME}
    return {**sections, "axes": axes, "slow_time": slow_time, "mission": [block.as_table() for block in study.mission]}


def block_studies(
    sections: Mapping[str, Any], blocks: Sequence[MissionBlock], source: str, check: CheckStudy
) -> tuple[Study, ...]:
    """For each block a study of this block alone, with its scene and its axes, and as many cycles as all missions have.

    sections: tables of the study file, without axes of [scene] and [wear]. check: makes the study of tables, without
    room for wear.

    Raises
    ------
    UserError
        Where a parameter of a block is wrong.
    """
    found: list[Study] = []
    for block in blocks:
        own = {name: getattr(block, name) for name in OWN_AXES if isinstance(getattr(block, name), float)}
        tables = {name: table for name, table in sections.items() if name not in ("mission", "slow_time", "outputs")}
        tables["scene"] = {**sections["scene"], **block.parameters}
        tables["axes"] = {**_IDLE, **sections["axes"], **own}
        tables["outputs"] = {key: value for key, value in _table(sections, "outputs").items() if key == "scene"}
        try:
            study = check(tables)
        except UserError as error:
            key = error.key.removeprefix("scene.")
            if key.partition(".")[0] not in block.parameters:
                raise
            raise UserError(error.place, f"mission.{block.name}.{key}", error.value, error.remedy) from None
        if block.engine_order is not None:
            frequency = engine_frequency(block, study.scene.parameters, source)
            study = study.model_copy(update={"axes": study.axes.model_copy(update={"frequency": (frequency,)})})
        found.append(study)
    return tuple(found)


def with_room_of_all(study: Study) -> Study:
    """A study of missions whose blocks have room for the wear of all of them, in equal pairs."""
    cycles = study.missions_kept[-1] * sum(
        block.cycles_at(max(of_block.axes.frequency))
        for block, of_block in zip(study.mission, study.block_studies, strict=True)
    )
    ends = {"cycles": cycles, "until": study.slow_time.until}
    wearing = [
        with_room_for_wear(each.model_copy(update={"slow_time": each.slow_time.model_copy(update=ends)}))
        for each in study.block_studies
    ]
    parameters = [each.scene.parameters for each in wearing]
    widths = [width for each in parameters if isinstance(width := dict(each).get("half_width"), float)]
    if len(set(widths)) > 1:
        parameters = [each.model_copy(update={"half_width": max(widths)}) for each in parameters]
    scenes = [
        each.scene.model_copy(update={"parameters": of_block})
        for each, of_block in zip(wearing, parameters, strict=True)
    ]
    found = tuple(each.model_copy(update={"scene": scene}) for each, scene in zip(wearing, scenes, strict=True))
    return study.model_copy(update={"block_studies": found})


def _table(sections: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    table = sections.get(name, {})
    return table if isinstance(table, Mapping) else {}
