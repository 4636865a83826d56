"""What a periodic state must satisfy, from the full matrices of its model and the plain contact law.

Nothing here passes through the condensed structure, the kernels or the penalty of the solver.
"""

from dataclasses import dataclass

import numpy as np

from solver.model import ComplexArray, FloatArray, LinearModel, ReducedModel
from solver.results.history import PeriodicState


def harmonic_structure(model: ReducedModel, harmonic: int) -> LinearModel:
    """Structure that a harmonic sees, conjugated where its nodal diameter is folded: matrices, not `Z`."""
    if model.n_sectors == 0:
        return model.linear[0]
    wrapped = harmonic * model.nodal_diameter % model.n_sectors
    if 2 * wrapped <= model.n_sectors:
        return model.linear[wrapped]
    folded = model.linear[model.n_sectors - wrapped]
    return LinearModel(
        mass=folded.mass.conj(),
        damping=folded.damping.conj(),
        stiffness=folded.stiffness.conj(),
        load_static=folded.load_static,
        load_harmonic=folded.load_harmonic.conj(),
        response=folded.response.conj(),
    )


def amplitudes(values_h: FloatArray, harmonic: int) -> ComplexArray:
    """Complex amplitude X, `x(t) = Re(X exp(i n w t))`, of real coefficients; the mean for harmonic 0."""
    if harmonic == 0:
        return values_h[..., 0].astype(complex)
    return values_h[..., 2 * harmonic - 1] - 1j * values_h[..., 2 * harmonic]


def series(values_h: FloatArray, n_samples: int) -> FloatArray:
    """Time samples of a Fourier series."""
    phase = 2.0 * np.pi * np.arange(n_samples) / n_samples
    total = np.repeat(values_h[..., :1], n_samples, axis=-1)
    for harmonic in range(1, (values_h.shape[-1] + 1) // 2):
        total = total + values_h[..., 2 * harmonic - 1, None] * np.cos(harmonic * phase)
        total = total + values_h[..., 2 * harmonic, None] * np.sin(harmonic * phase)
    return total


@dataclass(frozen=True)
class FullMotion:
    """Motion of the whole structure that has the relative displacements of a state.

    displacement[n] (n_displacements,): complex amplitudes of harmonic n, m. imbalance[n]: N, what is missing from
    equilibrium under the loads and the contact force of the state; `force`, N, is the largest of those.
    """

    model: ReducedModel
    state: PeriodicState
    displacement: tuple[ComplexArray, ...]
    imbalance: tuple[float, ...]
    force: float

    def excitation_work(self) -> float:
        """Work of the excitation over a period, J."""
        load = self.state.excitation_amplitude * harmonic_structure(self.model, 1).load_harmonic
        return float(np.pi * np.imag(self.displacement[1].conj() @ load))

    def viscous_work(self) -> float:
        """What the damping takes over a period, J."""
        total = 0.0
        for n in range(1, len(self.displacement)):
            moved = self.displacement[n]
            damping = harmonic_structure(self.model, n).damping
            total += np.pi * n**2 * self.state.omega * float(np.real(moved.conj() @ damping @ moved))
        return total

    def response(self, harmonic: int = 1) -> ComplexArray:
        """Complex amplitudes (n_response,) of the responses, m."""
        return harmonic_structure(self.model, harmonic).response @ self.displacement[harmonic]


def full_motion(model: ReducedModel, state: PeriodicState) -> FullMotion:
    """Motion of the whole structure; relative displacements are given: a static structure may be free to slide."""
    n_harmonics = (state.displacement_h.shape[2] - 1) // 2
    exists = model.contact.dofs >= 0
    relative = model.contact.dofs[exists]
    moved, imbalance, largest = [], [], 0.0
    for n in range(n_harmonics + 1):
        linear = harmonic_structure(model, n)
        matrix = linear.stiffness + 1j * n * state.omega * linear.damping - (n * state.omega) ** 2 * linear.mass
        load = np.zeros(matrix.shape[0], complex)
        if n == 0:
            load += linear.load_static
        if n == 1:
            load += state.excitation_amplitude * linear.load_harmonic
        load[relative] -= amplitudes(state.contact_force_h, n)[exists]
        whole = np.zeros(matrix.shape[0], complex)
        whole[relative] = amplitudes(state.displacement_h, n)[exists]
        inner = np.setdiff1d(np.arange(whole.size), relative)
        if inner.size:
            right = (load - matrix @ whole)[inner]
            whole[inner] = np.linalg.solve(matrix[np.ix_(inner, inner)], right)
        moved.append(whole)
        imbalance.append(float(np.abs(matrix @ whole - load).max()))
        largest = max(largest, float(np.abs(load).max()), float(np.abs(state.contact_force_h).max()))
    return FullMotion(model, state, tuple(moved), tuple(imbalance), largest)


def contact_work(state: PeriodicState, force_t: FloatArray) -> float:
    """Work over a period, J, that contact forces (n_contact, 3, N), N, take from the motion of a state."""
    rate_h = np.zeros_like(state.displacement_h)
    for n in range(1, (rate_h.shape[2] + 1) // 2):
        rate_h[..., 2 * n - 1] = n * state.omega * state.displacement_h[..., 2 * n]
        rate_h[..., 2 * n] = -n * state.omega * state.displacement_h[..., 2 * n - 1]
    n_samples = force_t.shape[2]
    return float((force_t * series(rate_h, n_samples)).sum() * 2.0 * np.pi / state.omega / n_samples)
