"""Nonlinear modes of a joint: natural frequency and damping over the amplitude, from a model in Python."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike

from solver.forced_response import check_friction, check_numbers, check_settings, check_word, worn_model
from solver.model import ComplexArray, FloatArray, IntArray, ReducedModel
from solver.modes.points import Direction, follow_mode
from solver.outcome import Outcome
from solver.presentation import Presented
from solver.settings import SolverSettings


@dataclass(frozen=True, repr=False)
class Backbone(Presented):
    """A nonlinear mode at `n_amplitude` amplitudes.

    - amplitude (n_amplitude,): modal amplitude `sqrt(x_1^H M x_1)`, m sqrt(kg), as given; x_1: first harmonic of all
      displacements.
    - frequency, damping_ratio (n_amplitude,): natural frequency, Hz, and zeta, positive where the vibration decays.
    - frequency_error, damping_error (n_amplitude,): estimated absolute errors, Hz and dimensionless; inf where unknown.
    - response (n_amplitude, n_response): complex first harmonic, m, in phase with the linear mode.
    - shape (n_amplitude, n): complex x_1, m. Divided by the amplitude, the mass-normalised shape of the mode.
    - slip_fraction, open_fraction (n_amplitude, n_contact): fraction of the period in which a pair slips, or is open.
    - harmonics_used, samples_used (n_amplitude,): highest harmonic and samples; 0 where there is no state.
    - outcome, message: how the computation of each point ended.

    Values are NaN where no state was found.
    """

    OVER = ("amplitude", "modal_amplitude")
    SHOWN = ("frequency", "damping_ratio", "damping_error")
    DRAWN = ("frequency", "damping_ratio")

    amplitude: FloatArray
    frequency: FloatArray
    damping_ratio: FloatArray
    frequency_error: FloatArray
    damping_error: FloatArray
    response: ComplexArray
    shape: ComplexArray
    slip_fraction: FloatArray
    open_fraction: FloatArray
    harmonics_used: IntArray
    samples_used: IntArray
    outcome: tuple[Outcome, ...]
    message: tuple[str, ...]


def backbone(
    model: ReducedModel,
    amplitude: ArrayLike,
    friction_coefficient: ArrayLike | None,
    *,
    mode: int = 1,
    sweep: Direction = "up",
    settings: SolverSettings | None = None,
    wear_depth: ArrayLike | None = None,
) -> Backbone:
    """Natural frequency and damping ratio of a joint over the amplitude: the backbone curve of a nonlinear mode.

    By the extended periodic motion concept (`solver.modes.modal_model`). A point that fails spoils no other one.

    - model: from `build_model`, `studies.build_scene` or `studies.read_scene`. Its harmonic load is not used.
    - amplitude: (n_amplitude,) or one number, m sqrt(kg), in any order: modal amplitude, as in `Backbone`. The mode at
      an amplitude does not depend on the other amplitudes.
    - friction_coefficient: of all pairs, or (n_contact,). None for a model with its own, e.g. from a scene file.
    - mode: number of the linear mode, from 1 on in ascending frequency, from which the nonlinear one begins: closed
      pairs stick. Of a joint that has fewer such modes, as a mass on a rigid slider: closed pairs slide.
    - sweep: the amplitude is raised from zero ("up"), or raised to at least twice the amplitude of the point and then
      lowered ("down"). A joint whose mode exists only while it slides has "down" alone.
    - settings: the defaults of `SolverSettings` if not given.
    - wear_depth: (n_contact,), m, of a worn joint: opens the pairs as a gap does. Unworn if not given.

    Raises ValueError where a number is out of its range, where the model lacks nodal diameters that the harmonics need,
    and where friction coefficients are given twice, not at all, or not to each pair.
    """
    settings = SolverSettings() if settings is None else settings
    wanted = check_numbers("amplitude", amplitude, above=0.0)
    friction = check_friction(model, friction_coefficient)
    check_word("sweep", sweep, get_args(Direction))
    check_settings(model, settings)
    if isinstance(mode, bool) or int(mode) != mode or mode < 1:
        raise ValueError(f"mode: give a whole number from 1 on instead of {mode!r}")
    worn = worn_model(model, wear_depth)
    ascending, place = np.unique(wanted, return_inverse=True)
    found = dict(follow_mode(worn, friction, ascending, int(mode), sweep, settings))
    columns: dict[str, Any] = {}
    for name in (field.name for field in fields(Backbone) if field.name != "amplitude"):
        values = [getattr(found[index], name) for index in place.tolist()]
        columns[name] = tuple(values) if name in ("outcome", "message") else np.array(values)
    return Backbone(amplitude=wanted, **columns)
