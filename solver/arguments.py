"""Checks of what users give to the functions of this package; each raises ValueError with a sentence."""

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import get_args

import numpy as np
from numpy.typing import ArrayLike

from solver.model import FloatArray, ReducedModel, with_friction
from solver.outcome import check
from solver.packing import Packed
from solver.settings import Direction, SolverSettings

Progress = Callable[[str], object]
"""Takes a line about how far a computation is, as `print`."""

SECONDS_A_LINE = 2.0
"""Least time between two lines."""


def lines_to(progress: Progress | None) -> Callable[..., None]:
    """Gives `progress` a line from time to time, of what a computation says."""
    shown_at = time.monotonic()

    def keep(said: Packed | str, *_: object) -> None:
        nonlocal shown_at
        if progress is not None and isinstance(said, str) and time.monotonic() >= shown_at + SECONDS_A_LINE:
            shown_at = time.monotonic()
            progress(said)

    return keep


def check_case(
    model: ReducedModel,
    excitation_amplitude: float,
    friction_coefficient: ArrayLike | None,
    sweep: Direction,
    settings: SolverSettings | None,
) -> tuple[ReducedModel, float, SolverSettings]:
    """The model with its friction, checked excitation amplitude and settings."""
    load = check_number("excitation_amplitude", excitation_amplitude, least=0.0)
    rough = check_friction(model, friction_coefficient)
    check_word("sweep", sweep, get_args(Direction))
    return rough, load, check_settings(model, settings)


def check_settings(model: ReducedModel, given: SolverSettings | None) -> SolverSettings:
    """Settings that are allowed, and fit to the model and to each other; the defaults for None."""
    settings = SolverSettings() if given is None else given
    check_kind("settings", settings, SolverSettings)
    for name in ("harmonics", "samples"):
        number = getattr(settings, name)
        right = number == "auto" or (isinstance(number, int | np.integer) and number >= 1)
        check(f"settings.{name}", right, f'give a whole number from 1 on, or "auto", instead of {number!r}')
    for name in ("tolerance", "rtol"):
        number = check_number(f"settings.{name}", getattr(settings, name), above=0.0)
        check(f"settings.{name}", number < 1.0, "give a number between 0 and 1")
    highest = 1 if settings.harmonics == "auto" else settings.harmonics
    if not model.has_harmonics(highest):
        raise ValueError(f"the model does not hold the nodal diameters that harmonics up to {highest} see")
    enough = settings.samples == "auto" or settings.samples > 2 * highest
    check("settings.samples", enough, f"give more than {2 * highest}, twice the harmonics")
    return settings


def worn_model(model: ReducedModel, wear_depth: ArrayLike | None) -> ReducedModel:
    """The model whose pairs a wear depth (n_contact,), m, has opened; as given for None."""
    if wear_depth is None:
        return model
    depth, n_contact = check_numbers("wear_depth", wear_depth, least=0.0), model.contact.n_contact
    check("wear_depth", depth.size == n_contact, f"give a depth, m, for each of {n_contact} pairs, not {depth.size}")
    return replace(model, contact=replace(model.contact, gap=model.contact.gap + depth))


def check_friction(model: ReducedModel, given: ArrayLike | None) -> ReducedModel:
    """The model, which must be one, with the friction of its pairs, as `with_friction`."""
    if not isinstance(model, ReducedModel):
        raise ValueError(f"model: give what build_scene, read_scene or build_model gives, instead of {model!r}")
    friction = None if given is None else np.squeeze(check_numbers("friction_coefficient", given, least=0.0))
    return with_friction(model, friction)


def check_kind(name: str, given: object, kind: type) -> None:
    """Whether a value is of a class."""
    check(name, isinstance(given, kind), f"give {kind.__name__}(...)")


def check_word(name: str, given: str, known: tuple[str, ...]) -> None:
    """Whether a word is in the list of known words."""
    check(name, given in known, f"give one of {', '.join(known)} instead of {given!r}")


def check_number(name: str, given: ArrayLike, *, above: float = -math.inf, least: float = -math.inf) -> float:
    """One number, as `check_numbers`."""
    found = check_numbers(name, given, above=above, least=least)
    check(name, found.size == 1, "give one number")
    return float(found[0])


def check_numbers(name: str, given: ArrayLike, *, above: float = -math.inf, least: float = -math.inf) -> FloatArray:
    """Numbers as a vector: one or more, all finite and within the limit."""
    try:
        found = np.atleast_1d(np.array(given, np.float64))
    except (TypeError, ValueError):
        raise ValueError(f"{name}: give numbers instead of {given!r}") from None
    right = found.ndim == 1 and found.size > 0
    check(name, right, f"give one number, or a list of numbers, instead of shape {found.shape}")
    check(name, np.isfinite(found).all(), "give finite numbers")
    limit = f"above {above:g}" if above > -math.inf else f"of at least {least:g}"
    within = (found > above).all() and (found >= least).all()
    check(name, within, f"give values {limit} instead of {found.min():g}")
    return found
