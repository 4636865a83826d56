"""Rules between the tables of a study, which are right themselves. Each yields what breaks it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, get_args

from solver.settings import FIRST_HARMONICS
from studyrunner.coordinates import SCENE
from studyrunner.scatter import OF_PAIRS
from studyrunner.study.mission import OWN_AXES
from studyrunner.study.mistakes import nearest_name
from studyrunner.study.sections import AUTO, DEFAULT
from studyrunner.study.study import MISSIONS, MODES, NUMBERS, WEAR, Study
from studyrunner.values import Wrong
from studyrunner.variables import KEPT

_MOST_POINTS = 1_000_000


def broken_rules(study: Study) -> Iterator[Wrong]:
    """All that does not fit together. study: with its axes, without variants, and before it is complete."""
    for rule in (_kind, _blocks, _frequency, _variables, _size_of_result, _solver, _end, _scatter):
        yield from rule(study)


def _kind(study: Study) -> Iterator[Wrong]:
    """Keys have a use in a study of this kind; missions are counted where there are blocks."""
    kind, axes = study.kind, study.axes
    for name, keys in kind.unused.items():
        table = getattr(study, name)
        for key in [key for key in keys if key in table.model_fields_set]:
            if (value := getattr(table, key)) != ():
                yield Wrong(f"{name}.{key}", value, kind.why)
    worn, missions = study.scene.worn, study.slow_time.missions
    if kind is MODES and "ramp" in axes.sweep:
        yield Wrong("axes.sweep", "ramp", 'give "up" or "down": the modal amplitude is raised or lowered')
    if kind is MODES and worn is not None and not any(axis.key == ("worn",) for axis in study.scene_axes):
        remedy = "missing: give the cycle count of each depth, which is the coordinate cycle of the modes"
        yield Wrong("scene.worn.cycle", None, remedy)
    if kind is not MODES and axes.mode != (1,):
        yield Wrong("axes.mode", axes.mode, "give axes.modal_amplitude as well: mode is that of a nonlinear mode")
    if kind is MISSIONS and missions is None:
        remedy = "missing: give the number of missions, how often the blocks are repeated"
        yield Wrong("slow_time.missions", None, remedy)
    if kind is WEAR and missions is not None:
        remedy = "give blocks under [[mission]], which are repeated so often, or slow_time.cycles in its place"
        yield Wrong("slow_time.missions", missions, remedy)


def _blocks(study: Study) -> Iterator[Wrong]:
    """Each block has a frequency and can begin as it says; an axis has a use in one block at least."""
    blocks, axes = study.mission, study.axes
    for before, block in zip((*blocks[-1:], *blocks), blocks, strict=False):
        key = f"mission.{block.name}"
        if not block.gives("frequency") and not axes.frequency:
            remedy = "missing: give it here, or as axes.frequency for all blocks without one"
            yield Wrong(f"{key}.frequency", None, remedy)
        theirs, ours = before.parameters, block.parameters
        changed = [name for name in {**theirs, **ours} if theirs.get(name) != ours.get(name)]
        if block.begin == "continue" and changed:
            remedy = f'give "ramp": a block that continues has the {changed[0]} of the block before, {before.name}'
            yield Wrong(f"{key}.begin", block.begin, remedy)
        if block.begin == "sweep" and not block.is_passage and "ramp" in axes.sweep:
            remedy = 'give "ramp", or axes.sweep = "up" or "down": a sweep has a direction'
            yield Wrong(f"{key}.begin", block.begin, remedy)
    for name in (*OWN_AXES, *(axis.name for axis in study.scene_axes)):
        given = name not in OWN_AXES or name in axes.model_fields_set
        if blocks and given and all(block.gives(name) for block in blocks):
            yield Wrong(f"axes.{name}", None, f"leave it out: every block under [[mission]] gives its own {name}")


def _frequency(study: Study) -> Iterator[Wrong]:
    """The frequency is given once: in Hz, as a ratio, or as a resonance in a range."""
    axes, word, frequency = study.axes, _followed(study), list(study.axes.frequency or ())
    given = axes.model_fields_set & {"frequency", "frequency_ratio"}
    if study.kind is WEAR and not given:
        yield Wrong("axes.frequency", None, "missing: give it, in Hz, or frequency_ratio")
    if len(given) > 1:
        yield Wrong("axes.frequency", frequency, "leave it out, or frequency_ratio: give one of both")
    if word is None:
        if study.loading is not None:
            remedy = 'leave it out, or give axes.frequency = "resonance" or "peak", which is followed in this range'
            yield Wrong("loading", study.loading.model_dump(), remedy)
        return
    followed = f'a fixed frequency, and axes.frequency = "{word}" changes'
    if study.kind is MISSIONS:
        yield Wrong("axes.frequency", word, "give frequencies in Hz: blocks of a mission follow no resonance")
    if len(frequency) > 1:
        remedy = f'give "{word}" alone: every point has the frequency that it finds; the other is another study'
        yield Wrong("axes.frequency", frequency, remedy)
    if "ramp" in axes.sweep:
        yield Wrong("axes.sweep", "ramp", f'give "up" or "down": a ramp has {followed}')
    if "final" in axes.scheme:
        yield Wrong("axes.scheme", "final", f'give "adaptive": the scheme "final" has {followed}')


def _followed(study: Study) -> str | None:
    """What the frequency follows."""
    given: tuple[Any, ...] = study.axes.frequency or ()
    return next((each for each in given if isinstance(each, str)), None)


def _size_of_result(study: Study) -> Iterator[Wrong]:
    """A study has so many points at most, and two dimensions of the result have two names."""
    if "nodal_diameter" in study.dimensions and "natural_frequency" in study.scene_variables:
        remedy = "leave it out: it has a dimension nodal_diameter of its own; a study without this axis gives it"
        yield Wrong("outputs.variables", "natural_frequency", remedy)
    if (n_points := study.n_points) > _MOST_POINTS:
        longest = max(study.dimensions, key=lambda name: len(study.dimensions[name]))
        remedy = f"give fewer values: there are {n_points:.3g} points, and a study has at most {_MOST_POINTS}"
        key = "scatter.samples" if longest == "sample" else f"axes.{longest}"
        yield Wrong(key, len(study.dimensions[longest]), remedy)


def _variables(study: Study) -> Iterator[Wrong]:
    of_scene = (name for name in SCENE if name != "exact" or study.kind is WEAR)
    known = dict.fromkeys((*study.kind.asked, *of_scene))
    for name in study.outputs.variables:
        if name not in (DEFAULT, *KEPT, *known):
            remedy = f"give names out of {', '.join(known)}: {study.kind.name} do not have it"
            yield Wrong("outputs.variables", name, remedy)
        elif name in ("mesh", "exact") and name not in study.scene.offers:
            yield Wrong("outputs.variables", name, f"leave it out: the scene {study.scene.model} has none")
        elif name == "exact" and (study.to_the_end or _followed(study) or study.axes.frequency_ratio):
            remedy = "leave it out: it is of given frequencies and given cycle counts, which this study does not have"
            yield Wrong("outputs.variables", "exact", remedy)


def _solver(study: Study) -> Iterator[Wrong]:
    """Samples in a period resolve the harmonics; a law that depends on depths knows them."""
    # automatic harmonics begin with three
    automatic = [FIRST_HARMONICS] if AUTO in study.solver.harmonics else []
    most = max((*study.given_harmonics, *automatic), default=0)
    fewest = min((number for number in study.solver.samples if number != AUTO), default=None)
    if fewest is not None and fewest <= 2 * most:
        yield Wrong("solver.samples", fewest, f"give more than twice the {most} harmonics, at least {2 * most + 1}")
    if study.wear.law == "table" and study.scene.worn is not None:
        remedy = 'give another law: the factors of a "table" depend on depths, which a worn scene counts from 0'
        yield Wrong("wear.law", study.wear.law, remedy)


def _end(study: Study) -> Iterator[Wrong]:
    schemes, slow_time = study.axes.scheme, study.slow_time
    if study.to_the_end and "explicit" in schemes:
        remedy = 'give "adaptive" or "implicit": explicit steps cannot grow, as slow_time.cycles = inf asks for'
        yield Wrong("axes.scheme", "explicit", remedy)
    if "final" in schemes and not study.to_the_end:
        remedy = 'give inf: the scheme "final" finds the state at which nothing wears any more'
        yield Wrong("slow_time.cycles", slow_time.cycles, remedy)
    if "final" in schemes and slow_time.until is not None:
        remedy = 'leave it out: the scheme "final" has no way on which it could be reached'
        yield Wrong("slow_time.until", slow_time.until, remedy)


def _scatter(study: Study) -> Iterator[Wrong]:
    """Inputs of [scatter] are known and can scatter beside the other tables."""
    section = study.scatter
    if section is None:
        return
    of_pairs = section.of_pairs
    if of_pairs and "exact" in study.outputs.variables:
        remedy = f"leave it out: the closed form knows nothing of the {of_pairs[0]} that [scatter] draws for each pair"
        yield Wrong("outputs.variables", "exact", remedy)
    fields = type(study.scene.parameters).model_fields
    # numbers with fractions
    floats = [name for name, field in fields.items() if float in (field.annotation, *get_args(field.annotation))]
    known = [*(NUMBERS if study.kind.counted else ()), *OF_PAIRS, *floats, *study.wear.numbers]
    for name, scattered in section.inputs.items():
        key, absolute = f"scatter.{name}", scattered.distribution.is_absolute
        shown = scattered.distribution.model_dump(exclude_none=True)
        if name not in known:
            yield Wrong(key, None, f"unknown input, give {nearest_name(name, known)}")
        if name == "frequency" and (_followed(study) or study.axes.frequency_ratio):
            yield Wrong(key, None, "leave it out: each sample finds its own frequency")
        several = name in NUMBERS and len(getattr(study.axes, name) or ()) > 1
        if absolute and (several or any(axis.name == name for axis in study.scene_axes)):
            remedy = f"give one value of axes.{name}, or a distribution around the study's own values, as {{std = ...}}"
            yield Wrong(key, shown, remedy)
        for block in study.mission:
            if block.gives(name) and (absolute or name == "frequency"):
                other = "leave it out" if name == "frequency" else "give a distribution around own values"
                yield Wrong(key, shown, f"{other}: the block {block.name} gives a {name} of its own")
