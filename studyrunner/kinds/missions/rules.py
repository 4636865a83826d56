"""[[mission]]: the blocks of a mission, and what they ask of the other tables."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from solver.settings import Passage
from studyrunner.kinds.wear.kind import WEAR
from studyrunner.study.mistakes import check_tables, keys_as_given, nearest_name, raise_wrong
from studyrunner.study.scene_section import Origin, find_scene
from studyrunner.study.sections import IDLE_FREQUENCY, AxesSection, EvolutionSection, SlowTimeSection
from studyrunner.study.study import Study
from studyrunner.user_error import UserError
from studyrunner.values import Positive, Section, Wrong

_NO_KEYS_OF_BLOCKS = ("model", "worn", "mesh", "sectors")


def _check_block_name(value: str) -> str:
    if not value.strip() or not value.isprintable() or len(value) > 60 or "." in value:
        raise ValueError("give a name of at most 60 characters without a point, in quotes")
    return value


def _check_passage(value: dict[str, float]) -> dict[str, float]:
    if value.keys() != {"start", "stop", "rate"} or value["start"] == value["stop"]:
        raise ValueError("give {start = Hz, stop = another Hz, rate = Hz/s} for a passage")
    return {name: value[name] for name in ("start", "stop", "rate")}


_Passage = Annotated[dict[str, Positive], AfterValidator(_check_passage)]


class MissionBlock(Section):
    """A block of [[mission]]. Other keys are those of [scene] to which the block gives values of its own."""

    model_config = ConfigDict(extra="allow")

    name: Annotated[str, AfterValidator(_check_block_name)] = Field(
        description="of the block, a coordinate of the result"
    )
    frequency: Positive | _Passage | None = Field(
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
    evolution: EvolutionSection | None = Field(None, description="in place of [wear.evolution] in this block")

    def rules(self) -> Iterator[Wrong]:
        """A block has one frequency and one duration."""
        if self.frequency is not None and self.engine_order is not None:
            yield Wrong("engine_order", self.engine_order, "leave it out, or frequency: give one of both")
        if self.passage is not None and (self.cycles or self.seconds or self.begin != "sweep"):
            remedy = "leave out cycles, seconds and begin: a passage is a sweep, as long as its rate says"
            yield Wrong("frequency", self.frequency, remedy)
        if self.passage is None and (self.cycles is None) == (self.seconds is None):
            yield Wrong("cycles", self.cycles, "give either cycles or seconds, the duration of the block in a mission")

    @property
    def parameters(self) -> dict[str, Any]:
        """Keys of [scene] to which the block gives values of its own."""
        return self.model_extra or {}

    @property
    def passage(self) -> Passage | None:
        """The frequencies that it passes; None where the vibration is steady."""
        return Passage(**self.frequency) if isinstance(self.frequency, dict) else None

    def gives(self, name: str) -> bool:
        """Whether the block gives a value of its own to an axis."""
        own = self.engine_order is not None and name == "frequency"
        return own or name in self.parameters or (name in _OWN_AXES and getattr(self, name) is not None)

    def cycles_at(self, frequency: float) -> float:
        """Cycles of the block in one mission. frequency: of steady vibration, Hz."""
        if self.passage is not None:
            return self.passage.cycles
        return self.cycles if self.cycles is not None else (self.seconds or 0.0) * frequency

    def describe(self, frequency: float) -> str:
        """In words. frequency: of steady vibration, Hz."""
        cycles = f"{self.cycles_at(frequency):.4g} cycles a mission"
        if self.passage is not None:
            ends = f"{self.passage.start:g} to {self.passage.stop:g} Hz"
            return f"passage from {ends} at {self.passage.rate:g} Hz/s, {cycles}"
        how = "continues the block before" if self.begin == "continue" else f"begins with a {self.begin}"
        return f"{frequency:g} Hz, {cycles}, {how}"


_OWN_AXES = tuple(name for name in AxesSection.model_fields if name in MissionBlock.model_fields)
"""Axes of a study that a block may give a value of its own."""

TABLE = MissionBlock
"""Class of the table."""


def read_table(given: object, scene: type[BaseModel], source: str) -> tuple[MissionBlock, ...]:
    """The blocks of a study file, each right in itself; values of keys of [scene] are not looked at.

    given: what stands under `mission`. scene: what [scene] of this model consists of. Raises UserError.
    """
    if not isinstance(given, list) or not given or not all(isinstance(block, dict) for block in given):
        raise UserError(source, "mission", given, "give blocks in order, each under a line [[mission]]")
    tables: dict[str, Any] = {}
    for number, table in enumerate(given):
        name = table.get("name")
        place = f"mission.{name if isinstance(name, str) and name.isprintable() and name else number}"
        if place in tables:
            raise UserError(source, "mission.name", name, "give each block a name of its own")
        tables[place] = {"begin": "sweep", **table} if isinstance(table.get("frequency"), dict) else table
    blocks = check_tables(dict.fromkeys(tables, MissionBlock), tables, source)
    known = [*MissionBlock.model_fields, *(name for name in scene.model_fields if name not in _NO_KEYS_OF_BLOCKS)]
    raise_wrong(
        source,
        (
            Wrong(f"{place}.{key}", value, f"unknown key of a block, give {nearest_name(key, known)}")
            for place, block in blocks.items()
            for key, value in block.parameters.items()
            if key not in known
        ),
    )
    return tuple(blocks.values())


def broken_rules(study: Study) -> Iterator[Wrong]:
    """Each block has a frequency and can begin as it says; an axis has a use in one block at least."""
    blocks, axes = study.mission, study.axes
    if study.slow_time.missions is None:
        yield Wrong("slow_time.missions", None, "missing: give how often the blocks under [[mission]] are repeated")
    if "frequency_shift" in (study.slow_time.until or {}):
        remedy = "give wear_depth or worn_volume: blocks of a mission have frequencies of their own"
        yield Wrong("slow_time.until", study.slow_time.until, remedy)
    for before, block in zip((*blocks[-1:], *blocks), blocks, strict=False):
        key, (theirs, ours) = f"mission.{block.name}", (before.parameters, block.parameters)
        changed = any(theirs.get(name) != ours.get(name) for name in {**theirs, **ours})
        changed = changed or before.evolution != block.evolution
        if not block.gives("frequency") and not axes.frequency:
            yield Wrong(f"{key}.frequency", None, "missing: give it here, or axes.frequency for all blocks without one")
        no_sweep = block.begin == "sweep" and block.passage is None and "ramp" in axes.sweep
        if no_sweep or (block.begin == "continue" and changed):
            remedy = 'give "ramp": only blocks of the same joint continue, and axes.sweep sweeps up or down'
            yield Wrong(f"{key}.begin", block.begin, remedy)
    for name in (*_OWN_AXES, *(axis.name for axis in study.scene_axes)):
        given = name not in _OWN_AXES or name in axes.model_fields_set
        if given and all(block.gives(name) for block in blocks):
            yield Wrong(f"axes.{name}", None, f"leave it out: every block under [[mission]] gives its own {name}")


def complete(study: Study, given: Mapping[str, Any], origin: Origin) -> Study:
    """The study with a study of each block alone. given: keys of [scene] in the study file."""
    studies, source, scene = [], study.source, study.scene
    for block in study.mission:
        with keys_as_given({f"scene.{key}": f"mission.{block.name}.{key}" for key in block.parameters}):
            table = {"scene": {**given, **block.parameters}}
            parameters = check_tables({"scene": type(scene.parameters)}, table, source)["scene"]
            of_block = find_scene(scene.model_copy(update={"parameters": parameters}), origin)
        own = {name: (getattr(block, name),) for name in _OWN_AXES if isinstance(getattr(block, name), float)}
        if block.engine_order is not None:
            speed, key = dict(parameters).get("rotation_speed"), f"mission.{block.name}.engine_order"
            if not isinstance(speed, int | float) or speed <= 0.0:
                remedy = "give scene.rotation_speed above 0, rpm, which the order multiplies, or a frequency"
                raise UserError(source, key, block.engine_order, remedy)
            own["frequency"] = (block.engine_order * float(speed) / 60.0,)
        axes = study.axes.model_copy(update={"frequency": study.axes.frequency or (IDLE_FREQUENCY,), **own})
        alone = {
            "kind": WEAR,
            "tables": {},
            "block": block.name,
            "slow_time": SlowTimeSection(),
            "scene": of_block,
            "axes": axes,
            "wear": study.wear.model_copy(update={"evolution": block.evolution or study.wear.evolution}),
        }
        studies.append(study.model_copy(update=alone))
    return study.model_copy(update={"block_studies": tuple(studies)})
