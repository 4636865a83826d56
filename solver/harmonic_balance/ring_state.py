"""A sector's state in all sectors of its ring, where a small disturbance is any wave; the sector of a ring at rest."""

from dataclasses import replace
from functools import lru_cache
from typing import Any, TypeVar, cast

import numpy as np

from solver.harmonic_balance.dlft import Evaluation
from solver.model import ComplexArray, ReducedModel
from solver.structure.condensation import build_structure
from solver.structure.joint import Joint
from solver.structure.penalty import Penalty
from solver.structure.ring import RingModel, build_ring

T = TypeVar("T")


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

    parts: dict[str, Any] = {name: everywhere(part, n) for name, part in vars(at).items()}
    state = replace(at, **parts)
    penalty = Penalty(*(everywhere(part, n) for part in vars(joint.penalty).values()))
    structure = build_structure(ring, joint.omega, joint.excitation_amplitude, orders)
    whole = replace(joint, model=ring, contact=ring.contact, structure=structure, penalty=penalty)
    return whole.after(state.energy), state


def at_rest(joint: Joint) -> Joint | None:
    """The sector of a ring, without excitation; None for other joints, and where the contacts of sectors differ."""
    ring, contact = joint.model, joint.contact
    if not isinstance(ring, RingModel) or contact.evolution is not None or joint.hold is not None:
        return None
    parts = {name: getattr(contact, name) for name in ("gap", "normal_load", "friction_coefficient")}
    parts = {name: part.reshape(ring.n_sectors, -1) for name, part in parts.items()}
    if any((part != part[0]).any() for part in parts.values()):
        return None
    own = replace(ring.tuned.contact, **{name: part[0] for name, part in parts.items()})
    penalty = joint.penalty.at(np.arange(own.n_contact))
    structure = build_structure(ring.tuned, joint.omega, 0.0, joint.basis.orders)
    return replace(joint, model=replace(ring.tuned, contact=own), contact=own, structure=structure, penalty=penalty)


def everywhere(values: T, n_sectors: int) -> T:
    """An array of a sector's in all sectors; anything else as it is."""
    if not isinstance(values, np.ndarray):
        return values
    return cast("T", np.tile(values, (n_sectors, *(np.ndim(values) - 1) * (1,))))


def wave_of(disturbance: ComplexArray, n_sectors: int) -> int:
    """Nodal diameter of which a disturbance of all sectors has most; (N n,) displacements sector by sector."""
    sizes = np.linalg.norm(np.fft.fft(disturbance.reshape(n_sectors, -1), axis=0), axis=1)
    k = int(np.argmax(sizes))
    return min(k, n_sectors - k)
