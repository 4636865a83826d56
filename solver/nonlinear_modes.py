"""Nonlinear modes of a joint, from a model in Python: frequency and damping over the amplitude, and the response."""

from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from solver.arguments import (
    Progress,
    check_friction,
    check_number,
    check_numbers,
    check_settings,
    check_word,
    lines_to,
    worn_model,
)
from solver.model import ComplexArray, FloatArray, IntArray, ReducedModel
from solver.modes.points import Direction, follow_mode
from solver.outcome import Outcome, check
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
    - outcome, message: how the computation of each point ended. Values are NaN where no state was found.
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
    progress: Progress | None = None,
) -> Backbone:
    """Natural frequency and damping ratio of a joint over the amplitude: the backbone curve of a nonlinear mode.

    By the extended periodic motion concept (`solver.modes.modal_model`). A point that fails spoils no other one.

    - amplitude: (n_amplitude,) or one number, m sqrt(kg), in any order: modal amplitude, as in `Backbone`. The mode at
      an amplitude does not depend on the other amplitudes.
    - mode: number of the linear mode, from 1 on in ascending frequency, from which the nonlinear one begins: closed
      pairs stick. Of a joint that has fewer such modes, as a mass on a rigid slider: closed pairs slide.
    - sweep: the amplitude is raised from zero ("up"), or raised to at least twice the amplitude of the point and then
      lowered ("down"). A joint whose mode exists only while it slides has "down" alone.

    All others, and ValueError, as in `frequency_response`. The harmonic load of the model is not used.
    """
    wanted = check_numbers("amplitude", amplitude, above=0.0)
    model = check_friction(model, friction_coefficient)
    check_word("sweep", sweep, get_args(Direction))
    settings = check_settings(model, settings)
    whole = not isinstance(mode, bool) and int(mode) == mode and mode >= 1
    check("mode", whole, f"give a whole number from 1 on instead of {mode!r}")
    worn = worn_model(model, wear_depth)
    ascending, place = np.unique(wanted, return_inverse=True)
    found = dict(follow_mode(worn, ascending, int(mode), sweep, settings, lines_to(progress)))
    columns: dict[str, Any] = {}
    for name in (field.name for field in fields(Backbone) if field.name != "amplitude"):
        values = [getattr(found[index], name) for index in place.tolist()]
        columns[name] = tuple(values) if name in ("outcome", "message") else np.array(values)
    return Backbone(amplitude=wanted, **columns)


@dataclass(frozen=True)
class ModalResponse:
    """A frequency response from a nonlinear mode along its curve: up the side below the resonance, then down the other.

    - frequency (n,): Hz. The curve may pass a frequency several times.
    - amplitude (n,): modal amplitude, m sqrt(kg).
    - response (n, n_response): complex first harmonic, m, to a harmonic load Re(F exp(i omega t)).
    - damping_ratio (n,): of the mode at this amplitude.

    Where the resonance is beyond the largest amplitude of the mode, a row of NaN stands between the sides.
    """

    frequency: FloatArray
    amplitude: FloatArray
    response: ComplexArray
    damping_ratio: FloatArray


def modal_response(model: ReducedModel, mode: Backbone, excitation_amplitude: float, points: int = 50) -> ModalResponse:
    """Response to a harmonic load from a nonlinear mode alone.

    With the natural frequency omega, the damping ratio zeta and the mass-normalised shape phi at the modal amplitude a,

        (omega^2 - Omega^2 + 2 i zeta omega Omega) q = phi^H F,      abs(q) = a,

    is solved for the excitation frequency Omega, as a gives all others (Krack, Computers and Structures 154 (2015)
    59-71). Other modes are left out, and friction forces do not grow with the frequency as the damping term does: the
    response holds near the resonance alone.

    model: of the mode, with its harmonic load.
    mode: from `solver.backbone`, at two amplitudes or more that have a state. The load is limited to its amplitudes.
    excitation_amplitude: N, above 0; multiplies the harmonic load of the model.
    points: of a side between two amplitudes of the mode; values are interpolated over log(amplitude).

    Raises ValueError where the mode has fewer than two amplitudes with a state, where the excitation is not above 0, or
    where mode and model do not belong together.
    """
    linear = model.harmonic_structure(1)
    check_number("excitation_amplitude", excitation_amplitude, above=0.0)
    same = mode.shape.shape[1] == len(linear.mass)
    check("mode", same, "give a mode of this model: the number of its displacements is another one")
    _, order = np.unique(mode.amplitude, return_index=True)
    order = order[np.isfinite(mode.frequency[order])]
    check("mode", len(order) >= 2, "give a mode with a state at two amplitudes or more")
    known = np.log(mode.amplitude[order])
    at = np.unique(np.concatenate([np.linspace(*ends, points + 1) for ends in pairwise(known.tolist())]))

    def between(values: ComplexArray | FloatArray) -> ComplexArray:
        columns = np.reshape(values[order], (len(order), -1)).astype(complex)
        real, imaginary = (PchipInterpolator(known, part)(at) for part in (columns.real, columns.imag))
        return np.asarray(real + 1j * imaginary)

    size = np.exp(at)
    omega, zeta = 2.0 * np.pi * between(mode.frequency)[:, 0].real, between(mode.damping_ratio)[:, 0].real
    shape, shown = (between(part / mode.amplitude[:, None]) for part in (mode.shape, mode.response))
    force = excitation_amplitude * (shape.conj() @ linear.load_harmonic)
    # Omega^4 - 2 middle Omega^2 + omega^4 = |force|^2 / a^2
    middle = omega**2 * (1.0 - 2.0 * zeta**2)
    inside = middle**2 - omega**4 + (np.abs(force) / size) ** 2
    parts: list[tuple[np.ndarray, ...]] = []
    for direction in (1, -1):
        with np.errstate(invalid="ignore"):
            excited = np.sqrt(middle - direction * np.sqrt(inside))
        rows = np.flatnonzero(np.isfinite(excited))[::direction]
        at_rows, own = excited[rows], omega[rows]
        coordinate = force[rows] / (own**2 - at_rows**2 + 2j * zeta[rows] * own * at_rows)
        parts.append((at_rows / (2.0 * np.pi), size[rows], coordinate[:, None] * shown[rows], zeta[rows]))
    if inside[-1] > 0.0:
        parts.insert(1, tuple(np.full((1, *part.shape[1:]), np.nan, part.dtype) for part in parts[0]))
    return ModalResponse(*(np.concatenate(each) for each in zip(*parts, strict=True)))
