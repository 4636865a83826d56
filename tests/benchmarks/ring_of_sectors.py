"""All sectors of a travelling wave that move differently, as one real model: for the integration in time.

A wave of nodal diameter d on N sectors repeats after n = N / gcd(N, d) of them. A structure of these n sectors with the
matrices A_k of the nodal diameters k = 0, d, 2 d ... has in sectors i and j the block
1/n sum_m exp(2 pi i m (i - j) d / N) A_(m d), which is real, as A_(-k) is the conjugate of A_k.
"""

import math

import numpy as np

from solver.model import ContactInterface, FloatArray, LinearModel, ReducedModel


def ring_of_sectors(model: ReducedModel) -> ReducedModel:
    """Model with real matrices (n n_one, n n_one) and n times the pairs; its responses are those of the first sector.

    The first sector comes first in all arrays. Raises KeyError where the scene does not hold a nodal diameter.
    """
    n = model.n_sectors // math.gcd(model.n_sectors, model.nodal_diameter)
    phase = 2.0 * np.pi * model.nodal_diameter / model.n_sectors
    waves = np.exp(1j * phase * np.outer(np.arange(n), np.arange(n))) / np.sqrt(n)
    structures = [model.harmonic_structure(harmonic) for harmonic in range(n)]

    def whole(name: str) -> FloatArray:
        seen = (getattr(one, name) for one in structures)
        blocks = (np.kron(np.outer(wave, wave.conj()), matrix) for wave, matrix in zip(waves, seen, strict=True))
        found = np.asarray(sum(blocks))
        assert np.abs(found.imag).max() <= 1e-9 * np.abs(found.real).max(), f"{name} of the ring is not real"
        return np.ascontiguousarray(found.real)

    excited = structures[1]
    linear = LinearModel(
        *(whole(name) for name in ("mass", "damping", "stiffness")),
        np.tile(structures[0].load_static, n),
        np.kron(np.sqrt(n) * waves[1], excited.load_harmonic),
        np.kron(np.eye(1, n), excited.response),
    )
    one = model.contact
    shifts = len(excited.mass) * np.arange(n)[:, None, None]
    contact = ContactInterface(
        np.where(one.dofs < 0, -1, one.dofs + shifts).reshape(-1, 3),
        *(np.tile(values, n) for values in (one.area, one.gap, one.normal_load)),
        np.tile(one.position, (n, 1)),
        one.surface * n,
    )
    return ReducedModel({0: linear}, contact, model.response_names)
