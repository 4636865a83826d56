"""The forced response of an unworn joint over frequency: one frequency response from a model in Python."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import get_args

import numpy as np
from numpy.typing import ArrayLike

from solver.loading_history.start_states import follow_branch
from solver.loading_history.sweep_start import Sweep
from solver.model import ComplexArray, FloatArray, IntArray, ReducedModel
from solver.outcome import Outcome
from solver.results.history import WearHistory
from solver.settings import SolverSettings
from solver.structure.joint import friction_of_pairs
from solver.wear.history import integrate_wear
from solver.wear.solutions import SlowTime

_UNWORN = np.zeros(1)  # the only cycle count


@dataclass(frozen=True)
class FrequencyResponse:
    """Unworn periodic states over frequency, at `n_frequency` points.

    frequency (n_frequency,): Hz, as given. response (n_frequency, n_response): complex first harmonic, m; the response
    is Re(value exp(i omega t)). response_peak (n_frequency, n_response): largest magnitude over a period, m.
    response_error (n_frequency,): estimated relative error. All of them NaN where there is no state.
    outcome, message: how the computation of each point ended, and what that does not say by itself.
    branch (n_frequency,): number of folds that the sweep has jumped over on its way. fold_frequency (n_frequency,): Hz,
    the last of them; NaN if none.
    """

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
    sweep: Sweep = "up",
    settings: SolverSettings | None = None,
) -> FrequencyResponse:
    """Frequency response of an unworn joint.

    A point that fails is one point: its `outcome` and `message` say why, and the others are computed.

    Parameters
    ----------
    model
        As `build_model`, `studies.build_scene` and `studies.read_scene` give it.
    frequency
        (n_frequency,) or one number, Hz, in any order. A state does not depend on which others are asked for.
    excitation_amplitude
        N, multiplies the unit harmonic load of the model.
    friction_coefficient
        Of all pairs, or (n_contact,) of each; None for a model that has one of each pair, as a scene file may.
    sweep
        How a state is reached: "up" or "down" along the frequency, "ramp" by raising the excitation.
    settings
        The defaults of `SolverSettings` if not given.

    Raises
    ------
    ValueError
        Where a number is out of its range, the model does not hold the nodal diameters that the harmonics need, or
        friction coefficients are given twice, not at all, or not to each pair.
    """
    settings = SolverSettings() if settings is None else settings
    wanted = check_numbers("frequency", frequency, above=0.0)
    load, friction = check_case(model, excitation_amplitude, friction_coefficient, sweep, settings)
    ascending, place = np.unique(wanted, return_inverse=True)
    found: dict[int, WearHistory] = {}
    branch = follow_branch(model, friction, load, ascending, sweep, settings)
    for index, start in branch:
        # a state is reported as at cycle 0 of any wear history; nothing wears until then
        found[index] = integrate_wear(model, friction, settings, start, SlowTime(0.0, "implicit", _UNWORN, 1.0))
    points = [found[index] for index in place.tolist()]
    return FrequencyResponse(
        frequency=wanted,
        response=np.array([point.response[0] for point in points]),
        response_peak=np.array([point.response_peak[0] for point in points]),
        response_error=np.array([point.response_error[0] for point in points]),
        outcome=tuple(point.outcome for point in points),
        message=tuple(point.message for point in points),
        branch=np.array([point.branch for point in points], np.int64),
        fold_frequency=np.array([point.fold_frequency for point in points]),
    )


def check_case(
    model: ReducedModel,
    excitation_amplitude: float,
    friction_coefficient: ArrayLike | None,
    sweep: Sweep,
    settings: SolverSettings,
) -> tuple[float, float | FloatArray | None]:
    """Excitation amplitude and friction coefficient. Raises ValueError where a joint cannot be computed like this."""
    load = check_number("excitation_amplitude", excitation_amplitude, least=0.0)
    friction = check_friction(model, friction_coefficient)
    check_word("sweep", sweep, get_args(Sweep))
    highest = 1 if settings.harmonics == "auto" else settings.harmonics
    if not model.holds(highest):
        raise ValueError(f"the model does not hold the nodal diameters that harmonics up to {highest} see")
    if settings.samples != "auto" and settings.samples <= 2 * highest:
        raise ValueError(f"settings.samples: give more than {2 * highest}, twice the harmonics")
    return load, friction


def check_friction(model: ReducedModel, given: ArrayLike | None) -> float | FloatArray | None:
    """One number, one of each pair (n_contact,), or None for those of the model. Raises ValueError where none fits."""
    friction: float | FloatArray | None = None
    if given is not None:
        numbers = check_numbers("friction_coefficient", given, least=0.0)
        friction = numbers if numbers.size > 1 else float(numbers[0])
    friction_of_pairs(model, friction)
    return friction


def check_word(name: str, given: str, known: tuple[str, ...]) -> None:
    """Raises ValueError where a text is none of those that are known."""
    if given not in known:
        raise ValueError(f"{name}: give one of {', '.join(known)} instead of {given!r}")


def check_number(name: str, given: ArrayLike, *, above: float = -math.inf, least: float = -math.inf) -> float:
    """The number. Raises ValueError where it is not one alone, or as `check_numbers`."""
    found = check_numbers(name, given, above=above, least=least)
    if found.size != 1:
        raise ValueError(f"{name}: give one number")
    return float(found[0])


def check_numbers(name: str, given: ArrayLike, *, above: float = -math.inf, least: float = -math.inf) -> FloatArray:
    """The numbers as a vector. Raises ValueError where there is none, or one of them is not finite or too small."""
    found = np.atleast_1d(np.array(given, np.float64))
    if found.ndim != 1 or not found.size or not np.isfinite(found).all():
        raise ValueError(f"{name}: give finite numbers")
    if (found <= above).any() or (found < least).any():
        limit = f"above {above:g}" if above > -math.inf else f"of at least {least:g}"
        raise ValueError(f"{name}: give values {limit} instead of {found.min():g}")
    return found
