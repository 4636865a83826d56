"""Forced response near a resonance from a nonlinear mode: single nonlinear mode theory."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import PchipInterpolator

from solver.model import ComplexArray, FloatArray, ReducedModel
from solver.nonlinear_modes import Backbone


@dataclass(frozen=True)
class ModalResponse:
    """A frequency response along its curve: up the side below the resonance, then down the other side.

    - frequency (n,): Hz. The curve may pass a frequency several times.
    - amplitude (n,): modal amplitude, m sqrt(kg).
    - response (n, n_response): complex first harmonic, m; the response is Re(value exp(i omega t)) to a harmonic load
      Re(F exp(i omega t)).
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

    is solved for the excitation frequency Omega, as a gives all others: two frequencies below the resonance, none
    above. Krack, Computers and Structures 154 (2015) 59-71; Schwarz and Krack, Journal of Vibration and Acoustics 142
    (2020). Other modes are left out, and friction forces do not grow with the frequency as the damping term does: the
    response holds near the resonance alone.

    model: of the mode, with its harmonic load.
    mode: from `solver.backbone`, at two amplitudes or more that have a state. The load is limited to its amplitudes.
    excitation_amplitude: N, above 0; multiplies the harmonic load of the model.
    points: of a side between two amplitudes of the mode; values are interpolated over log(amplitude).

    Raises ValueError where the mode has fewer than two amplitudes with a state, where the excitation is not above 0, or
    where mode and model do not belong together.
    """
    linear = model.harmonic_structure(1)
    if not 0.0 < excitation_amplitude < np.inf:
        raise ValueError(f"excitation_amplitude: give a finite number above 0 instead of {excitation_amplitude!r}")
    if mode.shape.shape[1] != len(linear.mass):
        raise ValueError("mode: give a mode of this model: the number of its displacements is another one")
    _, order = np.unique(mode.amplitude, return_index=True)
    order = order[np.isfinite(mode.frequency[order])]
    if len(order) < 2:
        raise ValueError("mode: give a mode with a state at two amplitudes or more")
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
