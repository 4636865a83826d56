"""A sector's state in all sectors of its ring, in which a small disturbance may be any wave."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from solver.harmonic_balance.dlft import Evaluation
from solver.model import ComplexArray, ReducedModel
from solver.structure.condensation import build_structure
from solver.structure.joint import Joint
from solver.structure.penalty import Penalty
from solver.structure.ring import RingModel, build_ring


def knows_ring(model: ReducedModel) -> bool:
    """Whether a model is one sector of a ring of which all nodal diameters are known."""
    return model.n_sectors > 1 and not isinstance(model, RingModel) and len(model.linear) > model.n_sectors // 2


@lru_cache(maxsize=4)
def _ring_of(model: ReducedModel) -> RingModel:
    return build_ring(model)


def in_ring(joint: Joint, at: Evaluation) -> tuple[Joint, Evaluation]:
    """Joint and state of all sectors, each of which does what the sector does, at its own time."""
    ring, orders = _ring_of(joint.model), joint.basis.orders
    n = ring.n_sectors

    def everywhere(values: Any) -> Any:
        return np.tile(values, (n, *(np.ndim(values) - 1) * (1,))) if isinstance(values, np.ndarray) else values

    state = replace(at, **{name: everywhere(part) for name, part in vars(at).items()})
    penalty = Penalty(*map(everywhere, vars(joint.penalty).values()))
    structure = build_structure(ring, joint.omega, joint.excitation_amplitude, orders)
    whole = replace(joint, model=ring, contact=ring.contact, structure=structure, penalty=penalty)
    return whole.after(state.energy), state


def wave_of(disturbance: ComplexArray, n_sectors: int) -> int:
    """Nodal diameter of which a disturbance of all sectors has most; (N n,) displacements sector by sector."""
    sizes = np.linalg.norm(np.fft.fft(disturbance.reshape(n_sectors, -1), axis=0), axis=1)
    k = int(np.argmax(sizes))
    return min(k, n_sectors - k)
