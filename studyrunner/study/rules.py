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
    for rule in (_variables, size_of_result, _solver, _end, _followed, wrong_scatter):
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
    """Variables are of the kind of study and of the scene."""
    known = dict.fromkeys((*study.variables, *(name for name in SCENE if name != "exact" or study.kind is WEAR)))
    for name in study.outputs.variables:
        if name not in known:
            remedy = f"give names out of {', '.join(known)}: {study.kind.name} do not have it"
            yield Wrong("outputs.variables", name, remedy)
        elif name in ("mesh", "exact") and name not in study.scene.offers:
            yield Wrong("outputs.variables", name, f"leave it out: the scene {study.scene.model} has none")
        elif name == "exact" and (study.to_the_end or study.follow is not None):
            remedy = "leave it out: it is of given frequencies and given cycle counts, which this study does not have"
            yield Wrong("outputs.variables", "exact", remedy)


def _solver(study: Study) -> Iterator[Wrong]:
    """Samples in a period resolve the harmonics; a law that depends on depths knows the depths."""
    most = max(study.given_harmonics, default=0)
    fewest = min((number for number in study.samples if number != AUTO), default=None)
    if fewest is not None and fewest <= 2 * most:
        table = "solver" if study.axes.samples is None else "axes"
        remedy = f"give more than twice the {most} harmonics, at least {2 * most + 1}"
        yield Wrong(f"{table}.samples", fewest, remedy)
    if study.wear.law == "table" and study.scene.worn is not None:
        remedy = 'give another law: the factors of a "table" depend on depths, which a worn scene counts from 0'
        yield Wrong("wear.law", study.wear.law, remedy)


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


def _followed(study: Study) -> Iterator[Wrong]:
    """A frequency that is followed is not fixed."""
    if study.follow is None:
        return
    followed = f'axes.frequency = "{study.follow.of}" changes'
    if "ramp" in study.axes.sweep:
        yield Wrong("axes.sweep", "ramp", f'give "up" or "down": a ramp has a fixed frequency, and {followed}')
    if "final" in study.axes.scheme:
        remedy = f'give "adaptive": the scheme "final" has a fixed frequency, and {followed}'
        yield Wrong("axes.scheme", "final", remedy)
