"""A body pressed on another, both elastic and without mass: the reduced model from the compliances of their surfaces.

With the contact forces lambda of the pairs (N, compression positive), the approach d of the body and its tangential
motion s, the relative displacements are `u_N = d - C_N lambda_N`, `u_T = s - C_T lambda_T`. So the stiffnesses
are the inverse compliances, between the pairs and the one displacement that moves them all. There is no mass: all is
quasi-static, and the frequency is that of the load alone.
"""

from __future__ import annotations

import numpy as np

from solver.model import BoolArray, ContactInterface, FloatArray, LinearModel, ReducedModel

_HOLDER = 1e-9
"""Stiffness that holds the body over that of the contact: every motion has some, and no result changes by more."""


def press_body(
    compliance: tuple[FloatArray, FloatArray],
    contact: ContactInterface,
    load: float,
    force: float | None,
    stroke: float | None,
    name: str,
) -> ReducedModel:
    """Reduced model; displacements are u_N of all pairs, u_T of all pairs, d, and where a force moves the body, s.

    A stroke moves the body whatever force it takes: the motion s is then no unknown, and `C_T^-1 s` a load on u_T.

    Parameters
    ----------
    compliance
        Normal and tangential one, (n_contact, n_contact), m/N.
    contact
        The pairs; their displacements are set here.
    load
        Normal force, N.
    force, stroke
        Amplitude of the tangential force, N, or of the motion, m, per unit of excitation amplitude; the other is None.
    name
        Of the response under a force, which is s. Under a stroke it is u_T of the pair nearest to the middle, "slip".
    """
    n = contact.n_contact
    normal, tangential = (np.asarray(np.linalg.inv(each), np.float64) for each in compliance)
    moved = force is not None
    stiffness = np.zeros((2 * n + 1 + moved, 2 * n + 1 + moved))
    _join(stiffness, np.arange(n), 2 * n, normal)
    load_static, load_harmonic = np.zeros((2, len(stiffness)))
    load_static[2 * n] = load
    response = np.zeros((1, len(stiffness)))
    if force is not None:
        _join(stiffness, np.arange(n, 2 * n), 2 * n + 1, tangential)
        load_harmonic[2 * n + 1] = force
        response[0, 2 * n + 1] = 1.0
    else:
        assert stroke is not None
        stiffness[n : 2 * n, n : 2 * n] = 0.5 * (tangential + tangential.T)
        load_harmonic[n : 2 * n] = stroke * tangential.sum(axis=1)
        response[0, n + int(np.argmin(np.linalg.norm(contact.position, axis=1)))] = 1.0
    linear = LinearModel(
        mass=np.zeros_like(stiffness),
        damping=np.zeros_like(stiffness),
        stiffness=stiffness,
        load_static=load_static,
        load_harmonic=load_harmonic.astype(np.complex128),
        response=response,
    )
    return ReducedModel({0: linear}, contact, (name if moved else "slip",))


def _join(stiffness: FloatArray, pairs: np.ndarray, body: int, joint: FloatArray) -> None:
    """Add the energy of the differences between one displacement of the body and those of the pairs, in place."""
    joint = 0.5 * (joint + joint.T)
    stiffness[np.ix_(pairs, pairs)] = joint
    stiffness[pairs, body] = stiffness[body, pairs] = -joint.sum(axis=1)
    stiffness[body, body] = (1.0 + _HOLDER) * joint.sum()


def pairs_of_patches(
    position: FloatArray, area: FloatArray, gap: FloatArray, surface: str, edge: BoolArray
) -> ContactInterface:
    """Pairs with a closing and one tangential displacement; position (n_contact, 3), m, area, m2, and gap, m.

    edge (n_contact,): those beside which the half-spaces go on without pairs.
    """
    n = len(area)
    dofs = np.stack([np.arange(n), np.arange(n, 2 * n), np.full(n, -1)], axis=1)
    return ContactInterface(dofs, area, gap, np.zeros(n), position, (surface,) * n, edge=edge)
