"""Checks of what users give to the functions of this package; each raises ValueError with a sentence."""

import math
from dataclasses import replace
from typing import get_args

import numpy as np
from numpy.typing import ArrayLike

from solver.model import FloatArray, ReducedModel
from solver.settings import Direction, SolverSettings
from solver.structure.joint import friction_of_pairs


def check_case(
    model: ReducedModel,
    excitation_amplitude: float,
    friction_coefficient: ArrayLike | None,
    sweep: Direction,
    settings: SolverSettings,
) -> tuple[float, float | FloatArray | None]:
    """Checked excitation amplitude and friction coefficient."""
    load = check_number("excitation_amplitude", excitation_amplitude, least=0.0)
    friction = check_friction(model, friction_coefficient)
    check_word("sweep", sweep, get_args(Direction))
    check_settings(model, settings)
    return load, friction


def check_settings(model: ReducedModel, settings: SolverSettings) -> None:
    """Whether settings are allowed, and fit to the model and to each other."""
    check_kind("settings", settings, SolverSettings)
    for name in ("harmonics", "samples"):
        given = getattr(settings, name)
        if given != "auto" and (not isinstance(given, int | np.integer) or given < 1):
            raise ValueError(f'settings.{name}: give a whole number from 1 on, or "auto", instead of {given!r}')
    for name in ("tolerance", "rtol"):
        if check_number(f"settings.{name}", getattr(settings, name), above=0.0) >= 1.0:
            raise ValueError(f"settings.{name}: give a number between 0 and 1")
    highest = 1 if settings.harmonics == "auto" else settings.harmonics
    if not model.has_harmonics(highest):
        raise ValueError(f"the model does not hold the nodal diameters that harmonics up to {highest} see")
    if settings.samples != "auto" and settings.samples <= 2 * highest:
        raise ValueError(f"settings.samples: give more than {2 * highest}, twice the harmonics")


def worn_model(model: ReducedModel, wear_depth: ArrayLike | None) -> ReducedModel:
    """The model whose pairs a wear depth (n_contact,), m, has opened; as given for None."""
    if wear_depth is None:
        return model
    depth = check_numbers("wear_depth", wear_depth, least=0.0)
    if depth.size != model.contact.n_contact:
        raise ValueError(f"wear_depth: give a depth, m, for each of {model.contact.n_contact} pairs, not {depth.size}")
    return replace(model, contact=replace(model.contact, gap=model.contact.gap + depth))


def check_friction(model: ReducedModel, given: ArrayLike | None) -> float | FloatArray | None:
    """One number, one for each pair (n_contact,), or None for those of the model, which must be one."""
    if not isinstance(model, ReducedModel):
        raise ValueError(f"model: give what build_scene, read_scene or build_model gives, instead of {model!r}")
    friction: float | FloatArray | None = None
    if given is not None:
        numbers = check_numbers("friction_coefficient", given, least=0.0)
        friction = numbers if numbers.size > 1 else float(numbers[0])
    friction_of_pairs(model, friction)
    return friction


def check_kind(name: str, given: object, kind: type) -> None:
    """Whether a value is of a class."""
    if not isinstance(given, kind):
        raise ValueError(f"{name}: give {kind.__name__}(...)")


def check_word(name: str, given: str, known: tuple[str, ...]) -> None:
    """Whether a word is in the list of known words."""
    if given not in known:
        raise ValueError(f"{name}: give one of {', '.join(known)} instead of {given!r}")


def check_number(name: str, given: ArrayLike, *, above: float = -math.inf, least: float = -math.inf) -> float:
    """One number, as `check_numbers`."""
    found = check_numbers(name, given, above=above, least=least)
    if found.size != 1:
        raise ValueError(f"{name}: give one number")
    return float(found[0])


def check_numbers(name: str, given: ArrayLike, *, above: float = -math.inf, least: float = -math.inf) -> FloatArray:
    """Numbers as a vector: one or more, all finite and within the limit."""
    try:
        found = np.atleast_1d(np.array(given, np.float64))
    except (TypeError, ValueError):
        raise ValueError(f"{name}: give numbers instead of {given!r}") from None
    if found.ndim != 1 or not found.size:
        raise ValueError(f"{name}: give one number, or a list of numbers, instead of shape {found.shape}")
    if not np.isfinite(found).all():
        raise ValueError(f"{name}: give finite numbers")
    if (found <= above).any() or (found < least).any():
        limit = f"above {above:g}" if above > -math.inf else f"of at least {least:g}"
        raise ValueError(f"{name}: give values {limit} instead of {found.min():g}")
    return found
