"""Rules between the tables of a study, which are right themselves. Each yields what breaks it."""

import math
from collections.abc import Iterator
from typing import Any, cast, get_args

from solver.settings import FIRST_HARMONICS
from studyrunner.kinds.table import KINDS
from studyrunner.measured import QUANTITIES
from studyrunner.scatter import LIVES, OF_PAIRS, SECTOR_FREQUENCY
from studyrunner.study.mistakes import nearest_name
from studyrunner.study.sections import ALLOWABLE, AUTO, DEFAULT
from studyrunner.study.study import Study
from studyrunner.values import Wrong

_MOST_POINTS = 1_000_000


def broken_rules(study: Study, first: bool) -> Iterator[Wrong]:
    """All that does not fit together. study: with its axes, without variants, and before it is complete. first: whether
    it is the first of the variants, which have the same axes.
    """
    of_all = (_keys, study.kind.broken_rules, _frequency, _amplitude, _measured) if first else ()
    for rule in (*of_all, _outputs, _solver_and_end, _scatter, _evolution, _ring):
        yield from rule(study)


def _keys(study: Study) -> Iterator[Wrong]:
    """Keys are read by studies of this kind."""
    kind = study.kind
    for table, section in ((name, getattr(study, name)) for name in ("axes", "slow_time", "wear", "outputs")):
        for key in type(section).model_fields:
            if key in section.model_fields_set and not kind.is_read(table, key) and getattr(section, key) != ():
                others = [each for each in KINDS.values() if each.is_read(table, key)]
                given = " or ".join(f"{each.marker}, for {each.words}" for each in others if each.marker)
                remedy = kind.why or f"leave it out, as {kind.words} do not read it, or give {given}"
                yield Wrong(f"{table}.{key}", getattr(section, key), remedy)


def _frequency(study: Study) -> Iterator[Wrong]:
    """The frequency is given once: in Hz, as a ratio, or as a resonance in a range."""
    axes, frequency = study.axes, [*cast("tuple[Any, ...]", study.axes.frequency or ())]
    word = next((each for each in frequency if isinstance(each, str)), None)
    given = axes.model_fields_set & {"frequency", "frequency_ratio"}
    if len(given) > 1:
        yield Wrong("axes.frequency", frequency, "give either it, in Hz, or frequency_ratio")
    if word is None and study.loading is not None:
        remedy = 'leave it out: it is the range of axes.frequency = "peak"'
        yield Wrong("loading", study.loading.model_dump(), remedy)
    if word is None:
        return
    if not study.kind.follows or len(frequency) > 1:
        yield Wrong("axes.frequency", frequency, f'give Hz: "{word}" stands alone, and goes with no mission')
    for key, other, instead in (("sweep", "ramp", '"up" or "down"'), ("scheme", "final", '"adaptive" or "implicit"')):
        if other in getattr(axes, key):
            yield Wrong(f"axes.{key}", other, f'give {instead} with axes.frequency = "{word}", or a frequency in Hz')


def _amplitude(study: Study) -> Iterator[Wrong]:
    """An amplitude that is sought has a target to meet after the last cycle."""
    amplitude, until = cast("tuple[Any, ...]", study.axes.excitation_amplitude), study.slow_time.until or {}
    if ALLOWABLE not in amplitude:
        return
    if len(amplitude) > 1 or study.kind is not KINDS["wear"] or "final" in study.axes.scheme:
        remedy = f'give N: "{ALLOWABLE}" stands alone, in a study of wear histories without the scheme "final"'
        yield Wrong("axes.excitation_amplitude", amplitude, remedy)
    if not {"wear_depth", "worn_volume"} & {*until}:
        remedy = f"give a wear_depth, m, or a worn_volume, m3, that the {ALLOWABLE} excitation meets after all cycles"
        yield Wrong("slow_time.until", until or None, remedy)
    if not 0.0 < study.slow_time.cycles < math.inf:
        yield Wrong("slow_time.cycles", study.slow_time.cycles, "give the number of cycles after which until is met")
    if 0.0 in study.axes.wear_coefficient:
        yield Wrong("axes.wear_coefficient", 0.0, f"give numbers above 0: with 0 every excitation is {ALLOWABLE}")
    if study.scatter is not None and "excitation_amplitude" in study.scatter.inputs:
        yield Wrong("scatter.excitation_amplitude", None, "leave it out: the amplitude of each sample is sought")


def _measured(study: Study) -> Iterator[Wrong]:
    """What was measured is computed, and as long as it was measured."""
    for name, each in study.measured.all if study.measured else ():
        variable, key = QUANTITIES[name].variables[0], f"measured.{name}"
        if variable not in study.kind.asked:
            yield Wrong(key, None, f"leave it out: studies of {study.kind.words} do not compute it")
        elif study.kind.counted:
            last = max(each.at) if each.over == "cycle" else each.cycle or 0.0
            if last > study.output_counts[-1] and not study.to_the_end:
                remedy = f"raise slow_time.{study.kind.counted}s: the study ends at {study.output_counts[-1]:g}"
                yield Wrong(f"{key}.{'at' if each.over == 'cycle' else 'cycle'}", last, remedy)


def _outputs(study: Study) -> Iterator[Wrong]:
    """Variables are those of such a study, of different names, and of so many points at most."""
    known = [*study.kind.asked, *study.kind.scene]
    of_pairs = study.scatter is not None and bool(study.scatter.of_pairs)
    no_exact = study.to_the_end or study.loading is not None or study.axes.frequency_ratio or of_pairs
    for name in study.outputs.variables:
        remedy = ""
        if name not in (DEFAULT, *study.kind.always, *known):
            remedy = f"give {nearest_name(name, known)}, for {study.kind.words}"
        elif name in ("mesh", "exact") and (name not in study.scene.source.offers or (name == "exact" and no_exact)):
            remedy = f"leave it out: the scene {study.scene.model} has none"
            remedy += ", or not with these frequencies, cycle counts and pairs" if name == "exact" else ""
        elif name == "natural_frequency" and "nodal_diameter" in study.dimensions and name in study.scene_variables:
            remedy = "leave it out: its own dimension is nodal_diameter, too"
        if remedy:
            yield Wrong("outputs.variables", name, remedy)
    if study.n_points > _MOST_POINTS:
        longest = max(study.dimensions, key=lambda name: len(study.dimensions[name]))
        remedy = f"give fewer values: there are {study.n_points:.3g} points, and a study has at most {_MOST_POINTS}"
        key = "scatter.samples" if longest == "sample" else f"axes.{longest}"
        yield Wrong(key, len(study.dimensions[longest]), remedy)


def _solver_and_end(study: Study) -> Iterator[Wrong]:
    """Samples in a period resolve the harmonics; a law that depends on depths knows them; histories can end."""
    schemes, slow_time = study.axes.scheme, study.slow_time
    # automatic harmonics begin with three
    most = max((*study.given_harmonics, *([FIRST_HARMONICS] if AUTO in study.solver.harmonics else ())), default=0)
    fewest = min((number for number in study.solver.samples if number != AUTO), default=None)
    if fewest is not None and fewest <= 2 * most:
        yield Wrong("solver.samples", fewest, f"give more than twice the {most} harmonics, at least {2 * most + 1}")
    if study.wear.law == "table" and study.scene.worn is not None:
        remedy = "give another law: its factors are of depths, which a worn scene counts from 0"
        yield Wrong("wear.law", "table", remedy)
    if study.to_the_end and "explicit" in schemes:
        yield Wrong("axes.scheme", "explicit", 'give "adaptive" or "implicit": with cycles = inf steps have to grow')
    if "final" in schemes and (not study.to_the_end or slow_time.until is not None):
        remedy = "give slow_time.cycles = inf, without until, beside it: it finds where nothing wears any more"
        yield Wrong("axes.scheme", "final", remedy)


def _evolution(study: Study) -> Iterator[Wrong]:
    """What changes with the dissipated energy is given once, and a worn joint has dissipated some."""
    worn = study.scene.worn
    if study.evolving and worn is not None and not worn.energy:
        remedy = "missing: give it, J/m2, beside depth, or a result with dissipated_energy among its variables"
        yield Wrong("scene.worn.energy", None, remedy)
    for name in study.evolving.keys() & {"friction_coefficient", "contact_stiffness"}:
        remedy = f"leave it out: the first numbers of wear.evolution.{name} are those of the unworn joint"
        given = dict(study.scene.parameters).get(name)
        if name in study.scene.parameters.model_fields_set and given is not None:
            yield Wrong(f"scene.{name}", given, remedy)
        if study.scatter is not None and name in study.scatter.inputs:
            yield Wrong(f"scatter.{name}", None, remedy)
    for block in study.mission:
        evolution = block.evolution or study.wear.evolution
        for name in (evolution.tables.keys() if evolution else {}) & block.parameters.keys():
            remedy = f"leave it out: the first numbers of evolution.{name} are those of the unworn joint"
            yield Wrong(f"mission.{block.name}.{name}", block.parameters[name], remedy)


def _ring(study: Study) -> Iterator[Wrong]:
    """A ring is of studies that know one, and its friction is given once."""
    ring, scatter = study.scene.ring, study.scatter.inputs if study.scatter else {}
    of_sectors = [name for name, each in scatter.items() if each.of == "each sector"]
    if ring is None:
        for name in of_sectors:
            yield Wrong(f"scatter.{name}", None, 'give scene.sectors = "all" beside it: one sector stands for all')
        if study.scene.forced_sector is not None:
            yield Wrong("scene.forced_sector", study.scene.forced_sector, 'give scene.sectors = "all" beside it')
        return
    given, once = dict(study.scene.parameters)["friction_coefficient"], "leave it out: scene.sectors gives friction"
    if ring.friction and "friction_coefficient" in study.scene.parameters.model_fields_set and given is not None:
        yield Wrong("scene.friction_coefficient", given, once)
    if ring.friction and "friction_coefficient" in study.evolving:
        yield Wrong("wear.evolution.friction_coefficient", None, once)
    if ring.friction and "friction_coefficient" in {*scatter} - {*(study.scatter.of_pairs if study.scatter else ())}:
        yield Wrong("scatter.friction_coefficient", None, f'{once}, or give of = "each sector"')
    if any(ring.wear_depth) and study.evolving:
        remedy = "leave it out: with [wear.evolution] give scene.worn, with the energy that was dissipated"
        yield Wrong("scene.sectors.wear_depth", None, remedy)


def _limits(study: Study) -> Iterator[Wrong]:
    """Limits are of the wear after all cycles, or with a target of the life until then."""
    limits = study.scatter.given_limits if study.scatter else {}
    counted, until = study.kind.counted, study.slow_time.until
    life = f"{counted}s_to_target"
    if limits and (not counted or study.allowable):
        remedy = "leave it out: it asks for the wear after all cycles or missions at a given excitation"
        yield Wrong("scatter.limits", limits, remedy)
    elif (until and {*limits} - {life}) or {*limits} & LIVES - {life if until else ""}:
        remedy = f"give {life} with slow_time.until, of histories that end there, other limits without until"
        yield Wrong("scatter.limits", limits, remedy)
    elif until and limits and limits[life] > study.output_counts[-1]:
        remedy = f"give at most the {study.output_counts[-1]:g} {counted}s of slow_time"
        yield Wrong(f"scatter.limits.{life}", limits[life], remedy)


def _scatter(study: Study) -> Iterator[Wrong]:
    """Inputs of [scatter] are known and can scatter beside the other tables."""
    fields = type(study.scene.parameters).model_fields
    # numbers with fractions
    floats = [name for name, field in fields.items() if float in (field.annotation, *get_args(field.annotation))]
    known = [*study.kind.numbers, *OF_PAIRS, SECTOR_FREQUENCY, *floats, *study.wear.numbers]
    yield from _limits(study)
    for name, scattered in study.scatter.inputs.items() if study.scatter else ():
        several = name in study.kind.numbers and len(getattr(study.axes, name) or ()) > 1
        giving = any(block.gives(name) for block in study.mission)
        if name not in known:
            yield Wrong(f"scatter.{name}", None, f"unknown input, give {nearest_name(name, known)}")
        if name == "frequency" and (study.loading is not None or study.axes.frequency_ratio or giving):
            remedy = "leave it out: each sample, or a block, has a frequency of its own"
            yield Wrong(f"scatter.{name}", None, remedy)
        if scattered.distribution.is_absolute and (
            giving or several or any(axis.name == name for axis in study.scene_axes)
        ):
            remedy = "give a distribution around own values, as {std = ...}: an axis or a block gives values"
            yield Wrong(f"scatter.{name}", scattered.distribution.model_dump(exclude_none=True), remedy)
