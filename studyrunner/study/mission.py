"""[[mission]]: blocks of vibration in order, repeated `slow_time.missions` times in place of one vibration."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, Field

from studyrunner.study.mistakes import Mistakes, check_table
from studyrunner.study.sections import SOLVER_AXES, AxesSection
from studyrunner.user_error import UserError
from studyrunner.values import Positive, Section, Wrong, listed

_NO_KEYS = ("model", "worn", "mesh")


def _check_name(value: str) -> str:
    if not value.strip() or not value.isprintable() or len(value) > 60 or "." in value:
        raise ValueError("give a name of at most 60 characters without a point, in quotes")
    return value


def _check_passage(value: dict[str, float]) -> dict[str, float]:
    if value.keys() != {"start", "stop", "rate"} or value["start"] == value["stop"]:
        raise ValueError("give {start = Hz, stop = another Hz, rate = Hz/s} for a passage")
    return {name: value[name] for name in ("start", "stop", "rate")}


class MissionBlock(Section):
    """One block of a mission.

    parameters: keys of [scene] to which the block gives values of its own.
    """

    name: Annotated[str, AfterValidator(_check_name)] = Field(description="of the block, a coordinate of the result")
    frequency: Positive | Annotated[dict[str, Positive], AfterValidator(_check_passage)] | None = Field(
        None, description="Hz; or {start, stop, rate}: a passage, rate in Hz/s; or that of [axes]"
    )
    engine_order: Positive | None = Field(None, description="in place of frequency: order times rotation_speed / 60")
    cycles: Positive | None = Field(None, description="of steady vibration in one mission; or seconds")
    seconds: Positive | None = Field(None, description="s, of steady vibration in one mission; or cycles")
    begin: Literal["ramp", "sweep", "continue"] = Field(
        "ramp",
        description="the excitation rises from the static state, a sweep as axes.sweep says, or the last state of the"
        " block before",
    )
    excitation_amplitude: Positive | None = Field(None, description="N; or that of [axes]")
    parameters: dict[str, Any] = Field(default_factory=dict, exclude=True)

    def rules(self) -> Iterator[Wrong]:
        """A block has one frequency and one duration."""
        if self.frequency is not None and self.engine_order is not None:
            yield Wrong("engine_order", self.engine_order, "leave it out, or frequency: give one of both")
        durations = {key: getattr(self, key) for key in ("cycles", "seconds") if getattr(self, key) is not None}
        if self.is_passage:
            for key, value in durations.items():
                yield Wrong(key, value, "leave it out: a passage takes as long as its rate says")
            if self.begin != "sweep":
                yield Wrong("begin", self.begin, 'give "sweep", or leave it out: a passage is a sweep')
        elif not durations:
            yield Wrong("cycles", None, "missing: give cycles or seconds, the duration of the block in one mission")
        elif len(durations) > 1:
            yield Wrong("cycles", self.cycles, "leave it out, or seconds: give one, the duration of the block")

    @property
    def is_passage(self) -> bool:
        """Whether the frequency runs."""
        return isinstance(self.frequency, dict)

    def gives(self, name: str) -> bool:
        """Whether the block gives a value of its own to an axis."""
        own = self.engine_order is not None and name == "frequency"
        return own or name in self.parameters or (name in OWN_AXES and getattr(self, name) is not None)

    def cycles_at(self, frequency: float) -> float:
        """Cycles of the block in one mission. frequency: of steady vibration, Hz."""
        if isinstance(self.frequency, dict):
            return abs(self.frequency["stop"] ** 2 - self.frequency["start"] ** 2) / (2.0 * self.frequency["rate"])
        return self.cycles if self.cycles is not None else (self.seconds or 0.0) * frequency

    def describe(self, frequency: float) -> str:
        """In words. frequency: of steady vibration, Hz."""
        how = {"ramp": "begins with a ramp", "sweep": "begins with a sweep", "continue": "continues the block before"}
        cycles = f"{self.cycles_at(frequency):.4g} cycles a mission"
        if isinstance(self.frequency, dict):
            return "passage from {start:g} to {stop:g} Hz at {rate:g} Hz/s, ".format(**self.frequency) + cycles
        return f"{frequency:g} Hz, {cycles}, {how[self.begin]}"

    def as_table(self) -> dict[str, Any]:
        """The block as the study file has it."""
        own = {name: value for name, value in self.model_dump(mode="json").items() if value is not None}
        return {**own, **self.parameters}


OWN_AXES = tuple(name for name in AxesSection.model_fields if name in MissionBlock.model_fields)
"""Axes of a study that a block may give a value of its own."""


def read_blocks(
    given: object, axes: Mapping[str, Any], scene: type[BaseModel], found: Mistakes
) -> tuple[MissionBlock, ...]:
    """The blocks of a study file, checked one by one and against each other; none where one of them is wrong.

    given: what stands under `mission`. axes: table of the study file. scene: what [scene] of this model consists of.
    """
    if not isinstance(given, list) or not given or not all(isinstance(block, dict) for block in given):
        found.add("mission", given, "give blocks in order, each under a line [[mission]]")
        return ()
    blocks: list[MissionBlock] = []
    for number, table in enumerate(given):
        name = table.get("name")
        place = f"mission.{name if isinstance(name, str) and name.isprintable() and name else number}"
        with found.collecting():
            blocks.append(_read_block(table, place, scene, found))
            if name in [block.name for block in blocks[:-1]]:
                found.add("mission.name", name, "give each block a name of its own")
    if len(blocks) < len(given):
        return ()
    for before, block in zip((blocks[-1], *blocks), blocks, strict=False):
        for key, value, remedy in _wrong_beside(before, block, axes):
            found.add(f"mission.{block.name}.{key}", value, remedy)
    return tuple(blocks)


def _read_block(table: Mapping[str, Any], place: str, scene: type[BaseModel], found: Mistakes) -> MissionBlock:
    """A block; its parameters are looked at with those of the scene. Raises UserError."""
    of_scene = {name: name for name in scene.model_fields if name not in _NO_KEYS}
    own: dict[str, Any] = {"begin": "sweep"} if isinstance(table.get("frequency"), dict) else {}
    parameters = {}
    for key, value in table.items():
        if key in of_scene:
            if isinstance(value, list) or (isinstance(value, dict) and {"start", "stop", "num"} & value.keys()):
                found.add(f"{place}.{key}", value, "give one value: a block has one")
            parameters[key] = value
        elif key == "sweep":
            found.add(f"{place}.{key}", value, 'give begin = "sweep": its direction is that of axes.sweep')
        elif key in _NO_KEYS or (key in (*AxesSection.model_fields, *SOLVER_AXES) and key not in OWN_AXES):
            found.add(f"{place}.{key}", value, "leave it out: it is the same in all blocks")
        else:
            own[key if key != "parameters" else "parameter"] = value
    return check_table(MissionBlock, {**own, "parameters": parameters}, found.source, place, of_scene)


def _wrong_beside(before: MissionBlock, block: MissionBlock, axes: Mapping[str, Any]) -> Iterator[Wrong]:
    if not block.gives("frequency") and "frequency" not in axes:
        yield Wrong("frequency", None, "missing: give it here, or as axes.frequency for all blocks without one")
    if block.begin == "continue":
        theirs, ours = before.parameters, block.parameters
        changed = [key for key in {**theirs, **ours} if theirs.get(key) != ours.get(key)]
        if changed:
            remedy = f'give "ramp": a block that continues has the {changed[0]} of the block before, {before.name}'
            yield Wrong("begin", block.begin, remedy)
    elif block.begin == "sweep" and not block.is_passage and "ramp" in listed(axes.get("sweep")):
        yield Wrong("begin", block.begin, 'give "ramp", or axes.sweep = "up" or "down": a sweep has a direction')


def engine_frequency(block: MissionBlock, parameters: BaseModel, source: str) -> float:
    """Frequency of a block with an engine order, Hz. parameters: of its scene. Raises UserError."""
    speed, order = dict(parameters).get("rotation_speed"), block.engine_order or 0.0
    if not isinstance(speed, int | float) or speed <= 0.0:
        remedy = "give scene.rotation_speed above 0, rpm, which the engine order multiplies, or a frequency"
        raise UserError(source, f"mission.{block.name}.engine_order", order, remedy)
    return order * float(speed) / 60.0
