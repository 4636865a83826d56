"""[[mission]]: blocks of vibration in order, flown `slow_time.missions` times in place of one vibration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, Field, TypeAdapter

from studyrunner.study.checked_table import check_table
from studyrunner.study.similar_names import nearest_name
from studyrunner.study.values import Positive, Section, read, words
from studyrunner.user_error import UserError, WrongValueError

Begin = Literal["ramp", "sweep", "continue"]

OWN_AXES = ("frequency", "excitation_amplitude")
"""Axes of a study that a block may give a value of its own."""

_POSITIVE = TypeAdapter(Positive)
_PASSAGE = ("start", "stop", "rate")
_FORM = "give a number in Hz, or {start = Hz, stop = Hz, rate = Hz/s} for a passage"
_NO_KEYS = ("model", "worn", "mesh")


def _read_frequency(value: object) -> object:
    if not isinstance(value, dict):
        return read(_POSITIVE, value)
    if value.keys() != set(_PASSAGE):
        raise WrongValueError(value, _FORM)
    for name, each in value.items():
        try:
            read(_POSITIVE, each)
        except WrongValueError as error:
            raise WrongValueError(error.value, error.remedy, f"frequency.{name}") from None
    if value["start"] == value["stop"]:
        raise WrongValueError(value, "give a stop that differs from start: the frequency runs from one to the other")
    return {name: float(value[name]) for name in _PASSAGE}


def _read_name(value: object) -> str:
    if not isinstance(value, str) or not value.strip() or not value.isprintable() or len(value) > 60 or "." in value:
        raise WrongValueError(value, "give a name of at most 60 characters without a point, in quotes")
    return value


class MissionBlock(Section):
    """One block of a mission.

    parameters: keys of [scene] to which the block gives values of its own.
    """

    name: Annotated[str, BeforeValidator(_read_name)] = Field(description="of the block, a coordinate of the result")
    frequency: Annotated[float | dict[str, float] | None, BeforeValidator(_read_frequency)] = Field(
        None, description="Hz; a number, or {start, stop, rate} of a passage, whose rate is in Hz/s"
    )
    engine_order: Positive | None = Field(
        None, description="in place of a frequency: frequency over rotation_speed, which is in revolutions per second"
    )
    cycles: Positive | None = Field(None, description="cycles of steady vibration in one mission; or seconds")
    seconds: Positive | None = Field(None, description="duration of steady vibration in one mission, s; or cycles")
    begin: Annotated[Begin, words("ramp", "sweep", "continue")] = Field(
        "ramp",
        description="how the block begins: by raising the excitation, by a sweep, or from the last state of the block"
        " before; a passage is a sweep",
    )
    excitation_amplitude: Positive | None = Field(None, description="N; that of [axes] where it is left out")
    parameters: dict[str, Any] = Field(default_factory=dict, exclude=True)

    @property
    def is_passage(self) -> bool:
        """Whether the frequency runs."""
        return isinstance(self.frequency, dict)

    @property
    def has_frequency(self) -> bool:
        """Whether the block has a frequency of its own."""
        return self.frequency is not None or self.engine_order is not None

    def gives(self, name: str) -> bool:
        """Whether the block gives a value of its own to an axis."""
        if name == "frequency":
            return self.has_frequency
        return name in self.parameters or (name in OWN_AXES and getattr(self, name) is not None)

    def cycles_at(self, frequency: float) -> float:
        """Cycles of the block in one mission. frequency: of steady vibration, Hz."""
        if isinstance(self.frequency, dict):
            start, stop, rate = (self.frequency[name] for name in _PASSAGE)
            return abs(stop**2 - start**2) / (2.0 * rate)
        if self.cycles is not None:
            return self.cycles
        assert self.seconds is not None
        return self.seconds * frequency

    def as_table(self) -> dict[str, Any]:
        """The block as the study file has it."""
        own = {name: value for name, value in self.model_dump(mode="json").items() if value is not None}
        return {**own, **self.parameters}


def read_blocks(
    given: object, sections: Mapping[str, Any], scene: type[BaseModel], axes: type[BaseModel], source: str
) -> tuple[MissionBlock, ...]:
    """The blocks of a study file, checked one by one and against each other.

    Parameters
    ----------
    given
        What stands under `mission`.
    sections
        Tables of the study file.
    scene, axes
        What [scene] of this model and [axes] consist of.
    source
        File of the study, as the user named it.

    Raises
    ------
    UserError
        Where a block is wrong.
    """
    if not isinstance(given, list) or not given or not all(isinstance(block, dict) for block in given):
        raise UserError(source, "mission", given, "give blocks in order, each under a line [[mission]]")
    blocks: list[MissionBlock] = []
    for number, table in enumerate(given):
        name = table.get("name")
        if name is None:
            raise UserError(source, f"mission.{number}.name", None, "missing: give each block a name")
        try:
            _read_name(name)
        except WrongValueError as error:
            raise UserError(source, f"mission.{number}.name", name, error.remedy) from None
        block = _read_block(table, scene, axes, source)
        if block.name in [before.name for before in blocks]:
            raise UserError(source, "mission.name", name, "give each block a name of its own")
        blocks.append(block)
    for before, block in zip((blocks[-1], *blocks), blocks, strict=False):
        _check_block(before, block, sections, source)
    return tuple(blocks)


def _read_block(table: Mapping[str, Any], scene: type[BaseModel], axes: type[BaseModel], source: str) -> MissionBlock:
    own = [name for name in MissionBlock.model_fields if name != "parameters"]
    place = f"mission.{table['name']}"
    parameters = {}
    for key, value in table.items():
        if key in own:
            continue
        if key not in scene.model_fields or key in _NO_KEYS:
            if key == "sweep":
                remedy = 'give begin = "sweep": its direction is that of axes.sweep'
            elif key in axes.model_fields or key in _NO_KEYS:
                remedy = "leave it out: it is the same in all blocks"
            else:
                known = [*own, *(name for name in scene.model_fields if name not in _NO_KEYS)]
                remedy = f"unknown key, give {nearest_name(key, known)}"
            raise UserError(source, f"{place}.{key}", value, remedy)
        if isinstance(value, list) or (isinstance(value, dict) and {"start", "stop", "num"} & value.keys()):
            raise UserError(source, f"{place}.{key}", value, "give one value: a block has one")
        parameters[key] = value
    given: dict[str, object] = {key: value for key, value in table.items() if key in own}
    if isinstance(table.get("frequency"), dict):
        given.setdefault("begin", "sweep")
    try:
        return check_table(MissionBlock, {**given, "parameters": parameters}, source, place)
    except UserError as error:
        if error.key.startswith(place):
            raise
        raise UserError(source, f"{place}.{error.key}", error.value, error.remedy) from None


def _check_block(before: MissionBlock, block: MissionBlock, sections: Mapping[str, Any], source: str) -> None:
    """Raises UserError where keys of a block do not go together. before: the block before."""
    place = f"mission.{block.name}"

    def refuse(key: str, value: object, remedy: str) -> UserError:
        return UserError(source, f"{place}.{key}", value, remedy)

    if block.frequency is not None and block.engine_order is not None:
        raise refuse("engine_order", block.engine_order, "leave it out, or frequency: give one of both")
    if block.is_passage:
        for key in ("cycles", "seconds"):
            if getattr(block, key) is not None:
                raise refuse(key, getattr(block, key), "leave it out: a passage takes as long as its rate says")
        if block.begin != "sweep":
            raise refuse("begin", block.begin, 'give "sweep", or leave it out: a passage is a sweep')
    elif (block.cycles is None) == (block.seconds is None):
        what = "missing: give cycles or seconds" if block.cycles is None else "leave it out, or seconds: give one"
        raise refuse("cycles", block.cycles, f"{what}, the duration of the block in one mission")
    if not block.has_frequency and "frequency" not in sections["axes"]:
        raise refuse("frequency", None, "missing: give it here, or as axes.frequency for all blocks without one")
    if block.begin == "continue":
        theirs, ours = before.parameters, block.parameters
        changed = [key for key in {**theirs, **ours} if theirs.get(key) != ours.get(key)]
        if changed:
            remedy = f'give "ramp": a block that continues has the {changed[0]} of the block before, {before.name}'
            raise refuse("begin", block.begin, remedy)
    elif block.begin == "sweep" and not block.is_passage and "ramp" in sections["axes"].get("sweep", "up"):
        raise refuse("begin", block.begin, 'give "ramp", or axes.sweep = "up" or "down": a sweep has a direction')


def engine_frequency(block: MissionBlock, parameters: BaseModel, source: str) -> float:
    """Frequency of a block with an engine order, Hz. parameters: of its scene. Raises UserError."""
    assert block.engine_order is not None
    speed = dict(parameters).get("rotation_speed")
    if not isinstance(speed, int | float) or speed <= 0.0:
        remedy = (
            "give rotation_speed above 0, rpm, or a frequency: the frequency of an engine order is order times speed"
        )
        if speed is None:
            remedy = "give a frequency: the scene has no rotation_speed"
        raise UserError(source, f"mission.{block.name}.engine_order", block.engine_order, remedy)
    return block.engine_order * float(speed) / 60.0
