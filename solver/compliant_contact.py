"""Compliance of the contact itself: a spring in series with each pair.

Rough surfaces touch at their asperities only: per unit of area these are springs between the bodies, of the stiffnesses
kappa_N and kappa_T, N/m3, here linear and without damping. With the relative displacements v of the bodies and u of the
contact,

    Z v = F - lambda,      lambda = kappa alpha (v - u).

kappa_T is `TANGENTIAL_RATIO` kappa_N: 2 (1 - nu) / (2 - nu) for one circular contact that sticks (Mindlin, J. Appl.
Mech. 16 (1949)), and for randomly rough surfaces (Campana, Persson and Mueser, J. Phys.: Condens. Matter 23 (2011)
085001).
"""

from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from solver.model import (
    TANGENTIAL_RATIO,
    ContactInterface,
    Evolution,
    FloatArray,
    IntArray,
    LinearModel,
    Matrix,
    ReducedModel,
)
from solver.outcome import check

LARGEST_FRICTION = 2.0
"""Of an evolution: measured ones of dry metals are below 1.5."""

LARGEST_CONTACT_STIFFNESS = 1e22
"""N/m3. A spring between two layers of atoms in a metal has 1e21: what is stiffer is rigid."""


def with_contact_stiffness(model: ReducedModel, contact_stiffness: float | FloatArray) -> ReducedModel:
    """The model with a spring in series with each displacement of each pair that rubs.

    The relative displacements of the new model are those of the contact, at the same indices; the scaled compressions
    of the springs are further displacements at the end.

    contact_stiffness: kappa_N per area, N/m3, one number or (n_contact,); the tangential one is `TANGENTIAL_RATIO`
    times as large.
    Raises ValueError where it is not between 0 and `LARGEST_CONTACT_STIFFNESS`.
    """
    given = np.asarray(contact_stiffness, np.float64)
    right = bool(((given > 0.0) & (given <= LARGEST_CONTACT_STIFFNESS)).all())
    remedy = f"give a positive number, at most {LARGEST_CONTACT_STIFFNESS:g} N/m3"
    check(f"contact_stiffness is {contact_stiffness}", right, remedy)
    relative, springs = _springs(model.contact, given)
    scale = _scale_of(model.linear[0].stiffness, springs)
    linear = {k: _softened(each, relative, scale, springs * scale**2) for k, each in model.linear.items()}
    return replace(model, linear=linear)


def _springs(contact: ContactInterface, stiffness: FloatArray) -> tuple[IntArray, FloatArray]:
    """Relative displacements (n,) of pairs that rub, and their springs (n,), N/m, of a stiffness per area, N/m3."""
    components = contact.component_index
    rub = contact.rubs[components // 3]
    components, share = components[rub], np.where(components[rub] % 3 == 0, 1.0, TANGENTIAL_RATIO)
    of_pairs = np.broadcast_to(stiffness, contact.area.shape)[components // 3]
    return contact.relative[rub], of_pairs * share * contact.area[components // 3]


def _scale_of(stiffness: Matrix, springs: FloatArray) -> FloatArray:
    """Scale (n,) of compressions: those of stiff springs are small, and all stiffnesses are to be of one size."""
    largest = float(np.abs(np.diag(stiffness)).max())
    return np.sqrt(largest / (largest + springs)) if largest > 0.0 else np.ones(springs.size)


def with_evolution(
    model: ReducedModel,
    energy: ArrayLike,
    *,
    friction_coefficient: ArrayLike | None = None,
    contact_stiffness: ArrayLike | None = None,
    wear_factor: ArrayLike | None = None,
) -> ReducedModel:
    """The model of a joint whose contact changes with the energy that friction has dissipated at a pair over its area.

    Friction of a titanium pair rises while its oxide is rubbed off; joints of rough surfaces become stiffer while their
    asperities wear (Armand and others, Eur. J. Mech. A 72 (2018); Fantetti and others, Tribol. Int. 138 (2019)). All
    act in the balance of the same step on the slow time scale. Between the energies the properties are linear, beyond
    the last one constant. The friction coefficient of functions such as `march_wear` is then None.

    model: without a contact stiffness of its own where one is given here.
    energy (k,): J/m2, ascending from 0. friction_coefficient, contact_stiffness, N/m3, wear_factor, times the wear
    coefficient: (k,) for all pairs, or (n_contact, k); at least one of them. The unworn joint has the first ones.
    Raises ValueError where a table does not ascend or fit, a value is out of its range, or the model has it already.
    """
    at, n_contact = np.asarray(energy, np.float64), model.contact.n_contact
    right = at.ndim == 1 and at.size > 1 and at[0] == 0.0 and np.isfinite(at).all() and (np.diff(at) > 0.0).all()
    check("energy", right, "give at least two ascending numbers, the first of them 0, J/m2")
    tables = {"friction_coefficient": friction_coefficient, "contact_stiffness": contact_stiffness}
    tables["wear_factor"] = wear_factor
    most = {"friction_coefficient": LARGEST_FRICTION, "contact_stiffness": LARGEST_CONTACT_STIFFNESS}
    check("evolution", model.contact.evolution is None, "the model has one already")
    check("evolution", any(each is not None for each in tables.values()), "give " + ", ".join(tables))
    whole: dict[str, FloatArray | None] = dict.fromkeys(tables)
    for name, given in tables.items():
        if given is None:
            continue
        table = np.asarray(given, np.float64)
        check(name, table.shape in ((at.size,), (n_contact, at.size)), f"give {at.size} numbers, one for each energy")
        limit = most.get(name, np.inf)
        right = bool(((table > 0.0) & (table <= limit) & np.isfinite(table)).all())
        check(name, right, f"give numbers above 0, at most {limit:g}")
        whole[name] = np.array(np.broadcast_to(table, (n_contact, at.size)))
    stiffness, friction = whole["contact_stiffness"], whole["friction_coefficient"]
    if stiffness is not None:
        least = bool((stiffness >= stiffness[:, :1]).all())
        check("contact_stiffness", least, "give none below the first one, that of the unworn joint")
        model = with_contact_stiffness(model, stiffness[:, 0])
    twice = friction is not None and model.contact.friction_coefficient is not None
    check("friction_coefficient", not twice, "the model has one of its own already")
    contact = replace(model.contact, evolution=Evolution(at, **whole, begun=np.zeros(n_contact)))
    return replace(model, contact=contact.after(np.zeros(n_contact)))


def stiffened(model: ReducedModel, contact: ContactInterface) -> ReducedModel:
    """The model with the springs of a contact as they are now in its structure: for what knows no contact force."""
    evolution = contact.evolution
    now = evolution and evolution.now("contact_stiffness")
    if not evolution or not now:
        return model
    table, linear = np.asarray(evolution.contact_stiffness), dict[int, LinearModel]()
    first, springs = (_springs(contact, each)[1] for each in (table[:, 0], now[0]))
    # the compressions are the last displacements, of a ring those of each sector
    size, count = len(model.linear[0].mass) // model.n_repeated, first.size // model.n_repeated
    own = (size * np.arange(model.n_repeated)[:, None] + np.arange(size - count, size)).ravel()
    others = np.delete(np.arange(len(model.linear[0].mass)), own)
    scale = _scale_of(model.linear[0].stiffness[np.ix_(others, others)], first)
    for k, each in model.linear.items():
        stiffness = each.stiffness.copy()
        stiffness[own, own] += (springs - first) * scale**2
        parts = each.mass, each.damping, stiffness, each.load_static, each.load_harmonic, each.response
        linear[k] = LinearModel(*parts, each.blade)
    return replace(model, linear=linear)


def _softened(linear: LinearModel, relative: IntArray, scale: FloatArray, springs: FloatArray) -> LinearModel:
    """The linear model with the compressions over `scale` (n_rel,) as further displacements; springs (n_rel,): N/m."""
    n = len(linear.mass)
    # v = u + compression. With v as the second unknown the difference of two large stiffnesses would lose digits.
    places = np.concatenate([np.arange(n), relative])
    factor = np.concatenate([np.ones(n), scale])
    mass, damping, stiffness = (
        cast("Matrix", part[np.ix_(places, places)] * np.outer(factor, factor))
        for part in (linear.mass, linear.damping, linear.stiffness)
    )
    own = np.arange(n, len(places))
    stiffness[own, own] += springs
    load_static, load_harmonic = linear.load_static[places] * factor, linear.load_harmonic[places] * factor
    blade = None if linear.blade is None else linear.blade[:, places] * factor
    return LinearModel(mass, damping, stiffness, load_static, load_harmonic, linear.response[:, places] * factor, blade)
