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

from solver.model import FloatArray, IntArray, LinearModel, Matrix, ReducedModel
from solver.outcome import check

TANGENTIAL_RATIO = 2.0 * (1.0 - 0.3) / (2.0 - 0.3)
"""Tangential over normal contact stiffness: Mindlin's ratio for Poisson's ratio 0.3."""

LARGEST_CONTACT_STIFFNESS = 1e22
"""N/m3. A spring between two layers of atoms in a metal has 1e21: what is stiffer is rigid."""


def with_contact_stiffness(model: ReducedModel, contact_stiffness: float) -> ReducedModel:
    """The model with a spring in series with each displacement of each pair that rubs.

    The relative displacements of the new model are those of the contact, at the same indices; the scaled compressions
    of the springs are further displacements at the end.

    contact_stiffness: kappa_N per area, N/m3; the tangential one is `TANGENTIAL_RATIO` times as large.
    Raises ValueError where it is not between 0 and `LARGEST_CONTACT_STIFFNESS`.
    """
    right = 0.0 < contact_stiffness <= LARGEST_CONTACT_STIFFNESS
    remedy = f"give a positive number, at most {LARGEST_CONTACT_STIFFNESS:g} N/m3"
    check(f"contact_stiffness is {contact_stiffness}", right, remedy)
    components = model.contact.component_index
    rub = model.contact.rubs[components // 3]
    components, relative = components[rub], model.contact.relative[rub]
    share = np.where(components % 3 == 0, 1.0, TANGENTIAL_RATIO)
    springs = contact_stiffness * share * model.contact.area[components // 3]
    # Compressions of stiff springs are small. Their scale leaves all displacements with stiffnesses of one size.
    largest = float(np.abs(np.diag(model.linear[0].stiffness)).max())
    scale = np.sqrt(largest / (largest + springs)) if largest > 0.0 else np.ones(relative.size)
    linear = {k: _softened(each, relative, scale, springs * scale**2) for k, each in model.linear.items()}
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
    return LinearModel(mass, damping, stiffness, load_static, load_harmonic, linear.response[:, places] * factor)
