"""Rules between the tables of a study. Each yields what breaks it; one that needs a table that is wrong is left out."""

from __future__ import annotations

import math
from collections.abc import Iterator

from studyrunner.coordinates import SCENE
from studyrunner.study.kinds import WEAR
from studyrunner.study.mistakes import Mistakes
from studyrunner.study.realisation import wrong_scatter
from studyrunner.study.sections import AUTO
from studyrunner.study.study import Study
from studyrunner.values import Wrong

_MOST_POINTS = 1_000_000


def check_rules(study: Study, found: Mistakes, *, complete: bool) -> None:
    """Notes what breaks a rule. complete: whether the study has all tables; it has none that are wrong themselves."""
    for rule in (_variables, _offers, size_of_result, _worn, _samples, _end, _followed, wrong_scatter):
        try:
            for wrong in rule(study):
                found.add(*wrong)
        except AttributeError:
            if complete:
                raise


def size_of_result(study: Study) -> Iterator[Wrong]:
    """A study has so many points at most, and two dimensions of the result have two names."""
    if "nodal_diameter" in study.dimensions and "natural_frequency" in study.scene_variables:
        remedy = "leave it out: it has a dimension nodal_diameter of its own; a study without this axis gives it"
        yield Wrong("outputs.variables", "natural_frequency", remedy)
    n_points = math.prod(len(values) for values in study.dimensions.values())
    if n_points > _MOST_POINTS:
        longest = max(study.dimensions, key=lambda name: len(study.dimensions[name]))
        remedy = f"give fewer values: there are {n_points:.3g} points, and a study has at most {_MOST_POINTS}"
        key = "scatter.samples" if longest == "sample" else f"axes.{longest}"
        yield Wrong(key, len(study.dimensions[longest]), remedy)


def _variables(study: Study) -> Iterator[Wrong]:
    """Variables are of the kind of study."""
    offered = [name for name in SCENE if name != "exact" or study.kind is WEAR]
    for name in study.outputs.variables:
        if name not in (*study.variables, *offered):
            known = ", ".join(dict.fromkeys((*study.variables, *offered)))
            yield Wrong("outputs.variables", name, f"give names out of {known}: {study.kind.name} do not have it")


def _offers(study: Study) -> Iterator[Wrong]:
    """What is asked of the scene is there."""
    for name in ("mesh", "exact"):
        if name in study.outputs.variables and name not in study.scene.offers:
            yield Wrong("outputs.variables", name, f"leave it out: the scene {study.scene.model} has none")


def _worn(study: Study) -> Iterator[Wrong]:
    """A law that depends on depths knows the depths."""
    if study.scene.worn is not None and study.wear.law == "table":
        remedy = 'give another law: the factors of a "table" depend on depths, which a worn scene counts from 0'
        yield Wrong("wear.law", study.wear.law, remedy)


def _samples(study: Study) -> Iterator[Wrong]:
    """Samples in a period resolve the harmonics."""
    most = max(study.given_harmonics, default=0)
    fewest = min((number for number in study.samples if number != AUTO), default=None)
    if fewest is not None and fewest <= 2 * most:
        table = "solver" if study.axes.samples is None else "axes"
        remedy = f"give more than twice the {most} harmonics, at least {2 * most + 1}"
        yield Wrong(f"{table}.samples", fewest, remedy)


def _end(study: Study) -> Iterator[Wrong]:
    """Schemes and the end of the histories fit together."""
    if study.to_the_end and "explicit" in study.axes.scheme:
        remedy = 'give "adaptive" or "implicit": explicit steps cannot grow, as slow_time.cycles = inf asks for'
        yield Wrong("axes.scheme", "explicit", remedy)
    if "final" in study.axes.scheme and not study.to_the_end:
        remedy = 'give inf: the scheme "final" finds the state at which nothing wears any more'
        yield Wrong("slow_time.cycles", study.slow_time.cycles, remedy)
    if "final" in study.axes.scheme and study.slow_time.until is not None:
        remedy = 'leave it out: the scheme "final" has no way on which it could be reached'
        yield Wrong("slow_time.until", study.slow_time.until, remedy)
    if study.to_the_end and "exact" in study.outputs.variables:
        remedy = "leave it out: it is of given cycle counts, and slow_time.cycles = inf has none"
        yield Wrong("outputs.variables", "exact", remedy)


def _followed(study: Study) -> Iterator[Wrong]:
    """A frequency that is followed is neither fixed nor given."""
    if study.follow is None:
        return
    word = study.follow.of
    if "ramp" in study.axes.sweep:
        remedy = f'give "up" or "down": a ramp has a fixed frequency, and axes.frequency = "{word}" seeks it'
        yield Wrong("axes.sweep", "ramp", remedy)
    if "final" in study.axes.scheme:
        remedy = f'give "adaptive": the scheme "final" has a fixed frequency, and axes.frequency = "{word}" follows it'
        yield Wrong("axes.scheme", "final", remedy)
    if "exact" in study.outputs.variables:
        remedy = f'leave it out: it is of given frequencies, and axes.frequency = "{word}" has none'
        yield Wrong("outputs.variables", "exact", remedy)
