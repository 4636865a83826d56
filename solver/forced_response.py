"""The forced response of a joint over frequency: one frequency response from a model in Python."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
from numpy.typing import ArrayLike

from solver.harmonic_balance.state import largest_responses
from solver.loading_history.start_states import follow_branch
from solver.model import ComplexArray, FloatArray, IntArray, ReducedModel
from solver.outcome import Outcome, known_to
from solver.presentation import Presented
from solver.results.history import StartState, describe_cut_off, first_cut_off
from solver.results.state_report import evaluated
from solver.settings import Direction, SolverSettings
from solver.structure.fourier import to_complex
from solver.structure.joint import build_case, friction_of_pairs


@dataclass(frozen=True, repr=False)
class FrequencyResponse(Presented):
    """Periodic states over frequency, at `n_frequency` points, of an unworn joint or at a fixed wear depth.

    - frequency (n_frequency,): Hz, as given.
    - response (n_frequency, n_response): complex first harmonic, m; the response is Re(value exp(i omega t)).
    - response_peak (n_frequency, n_response): largest magnitude over a period, m.
    - response_error (n_frequency,): estimated relative error. NaN as the responses where no state was found.
    - outcome, message: how the computation of each point ended, and details.
    - branch, fold_frequency (n_frequency,): number of folds at which the sweep has jumped before it reached the point,
      and frequency of the last of them, Hz; NaN if there is none.
    """

    OVER = ("frequency", "frequency")
    SHOWN = ("response", "response_error", "fold_frequency")
    DRAWN = ("response",)

    frequency: FloatArray
    response: ComplexArray
    response_peak: FloatArray
    response_error: FloatArray
    outcome: tuple[Outcome, ...]
    message: tuple[str, ...]
    branch: IntArray
    fold_frequency: FloatArray


def frequency_response(
    model: ReducedModel,
    frequency: ArrayLike,
    excitation_amplitude: float,
    friction_coefficient: ArrayLike | None,
    *,
    sweep: Direction = "up",
    settings: SolverSettings | None = None,
    wear_depth: ArrayLike | None = None,
) -> FrequencyResponse:
    """Frequency response of a joint at fixed wear depth.

    Where a point fails, its `outcome` and `message` say why. The other points are computed all the same.

    model: from `build_model`, `studies.build_scene` or `studies.read_scene`.
    frequency: (n_frequency,) or one number, Hz, in any order. The state at a frequency does not depend on the others.
    excitation_amplitude: N, multiplies the unit harmonic load of the model.
    friction_coefficient: one number for all pairs, or (n_contact,). None for a model with its own.
    sweep: way to a state: "up" or "down" along the frequency, "ramp" with rising excitation at one frequency.
    wear_depth: (n_contact,), m, of a worn joint: opens the pairs as a gap does. Unworn if not given.

    Raises ValueError where a number is out of its range, where the model lacks nodal diameters that the harmonics need,
    and where friction coefficients are given twice, not at all, or not to each pair.
    """
    settings = SolverSettings() if settings is None else settings
    wanted = check_numbers("frequency", frequency, above=0.0)
    load, friction = check_case(model, excitation_amplitude, friction_coefficient, sweep, settings)
    model = worn_model(model, wear_depth)
    ascending, place = np.unique(wanted, return_inverse=True)
    found = dict(follow_branch(model, friction, load, ascending, sweep, settings))
    starts = [found[index] for index in place.tolist()]
    response, peak, outcome, message = zip(*(_read(model, friction, settings, start) for start in starts), strict=True)
    return FrequencyResponse(
        frequency=wanted,
        response=np.array(response),
        response_peak=np.array(peak),
        response_error=np.array([math.nan if start.state is None else start.response_error for start in starts]),
        outcome=outcome,
        message=message,
        branch=np.array([start.branch for start in starts], np.int64),
        fold_frequency=np.array([start.fold_frequency for start in starts]),
    )


def _read(
    model: ReducedModel, friction: float | FloatArray | None, settings: SolverSettings, start: StartState
) -> tuple[ComplexArray, FloatArray, Outcome, str]:
    """Response, peak, outcome and message of a point, as in `FrequencyResponse`."""
    state, outcome, message = start.state, start.outcome, start.message
    if state is None:
        nothing = np.full(len(model.response_names), np.nan)
        return nothing.astype(np.complex128), nothing, outcome, message
    case = build_case(model, friction, start.penalty_omega, settings, start.resolution)
    joint = case.joint(state.omega, state.excitation_amplitude)
    at = evaluated(joint, state)[1]
    pressure = state.contact_force_h[:, 0, 0] / model.contact.area
    if not math.isnan(first_cut_off(model.contact, np.zeros(1), pressure[None], state.wear_depth[None])):
        outcome, message = Outcome.CONTACT_CUT_OFF, describe_cut_off(0.0)
    elif outcome is Outcome.INACCURATE:
        error, name = max((start.wear_rate_error, "wear rate"), (start.response_error, "response"))
        message = f"the {name} {known_to(error, settings.rtol)}"
    response = to_complex(joint.structure.response_h(joint.to_relative(at.displacement_h)))[:, 0]
    return response, largest_responses(joint, at), outcome, message


def check_case(
    model: ReducedModel,
    excitation_amplitude: float,
    friction_coefficient: ArrayLike | None,
    sweep: Direction,
    settings: SolverSettings,
) -> tuple[float, float | FloatArray | None]:
    """Checked excitation amplitude and friction coefficient. Raises ValueError."""
    load = check_number("excitation_amplitude", excitation_amplitude, least=0.0)
    friction = check_friction(model, friction_coefficient)
    check_word("sweep", sweep, get_args(Direction))
    check_settings(model, settings)
    return load, friction


def check_settings(model: ReducedModel, settings: SolverSettings) -> None:
    """Raises ValueError where a setting is not allowed, or does not fit to the model or to another setting."""
    if not isinstance(settings, SolverSettings):
        raise ValueError("settings: give SolverSettings(...)")
    for name in ("harmonics", "samples"):
        given = getattr(settings, name)
        if given != "auto" and (not isinstance(given, int | np.integer) or given < 1):
            raise ValueError(f'settings.{name}: give a whole number from 1 on, or "auto", instead of {given!r}')
    for name in ("tolerance", "rtol"):
        if check_number(f"settings.{name}", getattr(settings, name), above=0.0) >= 1.0:
            raise ValueError(f"settings.{name}: give a number between 0 and 1")
    highest = 1 if settings.harmonics == "auto" else settings.harmonics
    if not model.holds(highest):
        raise ValueError(f"the model does not hold the nodal diameters that harmonics up to {highest} see")
    if settings.samples != "auto" and settings.samples <= 2 * highest:
        raise ValueError(f"settings.samples: give more than {2 * highest}, twice the harmonics")


def worn_model(model: ReducedModel, wear_depth: ArrayLike | None) -> ReducedModel:
    """The model whose pairs a wear depth (n_contact,), m, has opened; as given for None. Raises ValueError."""
    if wear_depth is None:
        return model
    depth = check_numbers("wear_depth", wear_depth, least=0.0)
    if depth.size != model.contact.n_contact:
        raise ValueError(f"wear_depth: give a depth, m, for each of {model.contact.n_contact} pairs, not {depth.size}")
    return replace(model, contact=replace(model.contact, gap=model.contact.gap + depth))


def check_friction(model: ReducedModel, given: ArrayLike | None) -> float | FloatArray | None:
    """One number, one for each pair (n_contact,), or None for those of the model. Raises ValueError where none fits, or
    where the model is none.
    """
    if not isinstance(model, ReducedModel):
        raise ValueError(f"model: give what build_scene, read_scene or build_model gives, instead of {model!r}")
    friction: float | FloatArray | None = None
    if given is not None:
        numbers = check_numbers("friction_coefficient", given, least=0.0)
        friction = numbers if numbers.size > 1 else float(numbers[0])
    friction_of_pairs(model, friction)
    return friction


def check_word(name: str, given: str, known: tuple[str, ...]) -> None:
    """Raises ValueError where a word is not in the list of known words."""
    if given not in known:
        raise ValueError(f"{name}: give one of {', '.join(known)} instead of {given!r}")


def check_number(name: str, given: ArrayLike, *, above: float = -math.inf, least: float = -math.inf) -> float:
    """One number. Raises ValueError where there are more, or as `check_numbers`."""
    found = check_numbers(name, given, above=above, least=least)
    if found.size != 1:
        raise ValueError(f"{name}: give one number")
    return float(found[0])


def check_numbers(name: str, given: ArrayLike, *, above: float = -math.inf, least: float = -math.inf) -> FloatArray:
    """The numbers as a vector. Raises ValueError where there is none, or where a number is not finite or too small."""
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
