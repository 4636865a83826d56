"""The model of a joint: a reduced linear structure and the contact pairs on it. All values are in SI units."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
ComplexArray = NDArray[np.complex128]
Matrix = NDArray[np.float64] | NDArray[np.complex128]


class _ByRows:
    """Parts of a model: their arrays are stored by rows (C order), as the last bits of sums depend on the order."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if isinstance(value, np.ndarray):
                object.__setattr__(self, name, np.asarray(value, order="C"))


class PairLaw(Protocol):
    """What some pairs of a scene follow in place of friction and separation, with its numbers: a `packable` class."""

    @property
    def pairs(self) -> tuple[int, ...]:
        """Indices of the pairs, ascending."""

    @property
    def rest_stiffness(self) -> FloatArray:
        """Stiffness (k, 3), N/m, of the pairs in small motions about rest: a linear mode begins with it."""

    def element(self, places: IntArray, *of_pairs: Any) -> Any:
        """The `solver.contact.element.Element` of these pairs in one joint, of which these are the first fields."""


TANGENTIAL_RATIO = 2.0 * (1.0 - 0.3) / (2.0 - 0.3)
"""Tangential over normal contact stiffness (`solver.compliant_contact`): Mindlin's ratio for Poisson's ratio 0.3."""


EVOLVING = ("friction_coefficient", "contact_stiffness", "wear_factor")
"""What may change with the dissipated energy, as `Evolution` has it."""


@dataclass(frozen=True)
class Evolution(_ByRows):
    """How the contact of pairs changes with the energy e that friction has dissipated there over their area, J/m2.

    Linear between the energies of the table, and constant beyond the last one.

    - energy (k,): J/m2, ascending from 0.
    - friction_coefficient, contact_stiffness, N/m3, and wear_factor, times the wear coefficient, each (n_contact, k);
      None for what does not change.
    - begun (n_contact,): energy at which the contact is now.
    """

    energy: FloatArray
    friction_coefficient: FloatArray | None
    contact_stiffness: FloatArray | None
    wear_factor: FloatArray | None
    begun: FloatArray

    def now(self, name: str) -> tuple[FloatArray, FloatArray] | None:
        """A property of the pairs at their energies (n_contact,), and its slope over the energy; None if constant."""
        table = getattr(self, name)
        if table is None:
            return None
        width, pairs = np.diff(self.energy), np.arange(len(table))
        place = np.clip(np.searchsorted(self.energy, self.begun, "right") - 1, 0, width.size - 1)
        slope = (table[pairs, place + 1] - table[pairs, place]) / width[place]
        inside = np.minimum(self.begun, self.energy[-1]) - self.energy[place]
        return table[pairs, place] + slope * inside, np.where(self.begun < self.energy[-1], slope, 0.0)


@dataclass(frozen=True)
class ContactInterface(_ByRows):
    """Contact pairs, `n_contact` of them.

    - dofs (n_contact, 3) int: indices of the closing, the first and the second tangential *relative* displacement of
      each pair in every `LinearModel` of the scene (blade minus disk; positive when the pair closes); -1 for none.
    - area (n_contact,): weight alpha of the pair, m2, Eq. (7). gap (n_contact,): initial gap, m.
    - normal_load (n_contact,): constant normal force, N, compression positive, of pairs without a closing displacement.
    - position (n_contact, 3): m, NaN where unknown. surface: label of each pair, e.g. "intrados".
    - friction_coefficient (n_contact,): None until it is given (`with_friction`).
    - edge (n_contact,): True for pairs at which the modelled contact ends but the bodies continue: load or wear of such
      a pair shows that the contact is cut off. None where the bodies end with their pairs.
    - laws: of pairs that do not rub and open; each pair belongs to one at most.
    - evolution: what changes with the energy that friction dissipates; None where nothing does.
    """

    dofs: IntArray
    area: FloatArray
    gap: FloatArray
    normal_load: FloatArray
    position: FloatArray
    surface: tuple[str, ...]
    friction_coefficient: FloatArray | None = None
    edge: BoolArray | None = None
    laws: tuple[PairLaw, ...] = ()
    evolution: Evolution | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        others = [pair for law in self.laws for pair in law.pairs]
        right = all(tuple(np.unique(law.pairs)) == law.pairs for law in self.laws) and len(set(others)) == len(others)
        if not right or not set(others) <= set(range(self.n_contact)):
            raise ValueError(
                f"laws: give to each ascending pairs from 0 to {self.n_contact - 1}, and each pair to one law only"
            )

    @property
    def n_contact(self) -> int:
        """Number of contact pairs."""
        return len(self.area)

    @cached_property
    def rubs(self) -> BoolArray:
        """False (n_contact,) for pairs with a law of `laws`."""
        return ~np.isin(np.arange(self.n_contact), [pair for law in self.laws for pair in law.pairs])

    @cached_property
    def rest_stiffness(self) -> FloatArray:
        """That of the laws of `laws` (n_contact, 3), N/m; 0 of pairs that rub."""
        stiffness = np.zeros((self.n_contact, 3))
        for law in self.laws:
            stiffness[list(law.pairs)] = law.rest_stiffness
        return stiffness

    @cached_property
    def friction(self) -> FloatArray:
        """Friction coefficient (n_contact,), which the model has; 0 of pairs with a law of `laws`."""
        assert self.friction_coefficient is not None
        return np.where(self.rubs, self.friction_coefficient, 0.0)

    def after(self, energy: FloatArray) -> "ContactInterface":
        """The contact after some more dissipated energy (n_contact,), J/m2; the same object where nothing changes."""
        if self.evolution is None:
            return self
        evolved = replace(self.evolution, begun=self.evolution.begun + energy)
        friction = evolved.now("friction_coefficient")
        coefficient = self.friction_coefficient if friction is None else friction[0]
        return replace(self, evolution=evolved, friction_coefficient=coefficient)

    @cached_property
    def evolves(self) -> bool:
        """Whether any property of a pair that rubs changes with the dissipated energy."""
        tables = [getattr(self.evolution, name, None) for name in EVOLVING]
        return any(table is not None and bool(np.diff(table, axis=1)[self.rubs].any()) for table in tables)

    def acting(self, energy: FloatArray) -> FloatArray:
        """Of a dissipated energy (n_contact,) what may change the contact: an error of the rest does not count."""
        return energy if self.evolves else np.zeros_like(energy)

    @cached_property
    def friction_slope(self) -> FloatArray:
        """Change of the friction coefficient with the dissipated energy (n_contact,), m2/J."""
        found = self.evolution and self.evolution.now("friction_coefficient")
        return np.where(self.rubs, found[1], 0.0) if found else np.zeros(self.n_contact)

    @cached_property
    def wear_factor(self) -> tuple[FloatArray, FloatArray]:
        """Wear coefficient over that of the history (n_contact,), and its change with the energy, m2/J."""
        found = self.evolution and self.evolution.now("wear_factor")
        return found or (np.ones(self.n_contact), np.zeros(self.n_contact))

    @cached_property
    def flexibility(self) -> tuple[FloatArray, FloatArray]:
        """Flexibility of the contact, less that in the linear structure (n_contact, 3), m/N, and its change with the
        energy. A spring kappa alpha in series moves a pair by `lambda / (kappa alpha)`, exactly in each harmonic.
        """
        evolution = self.evolution
        found = evolution and evolution.now("contact_stiffness")
        if not evolution or evolution.contact_stiffness is None or not found:
            return np.zeros((self.n_contact, 3)), np.zeros((self.n_contact, 3))
        (stiffness, slope), first, share = found, evolution.contact_stiffness[:, 0], self.flexibility_share
        return (1.0 / stiffness - 1.0 / first)[:, None] * share, (-slope / stiffness**2)[:, None] * share

    @cached_property
    def flexibility_share(self) -> FloatArray:
        """Flexibility, m/N, over the inverse contact stiffness, m3/N (n_contact, 3), of pairs that rub."""
        ratios = np.array([1.0, TANGENTIAL_RATIO, TANGENTIAL_RATIO])
        return np.asarray(self.rubs[:, None] / (self.area[:, None] * ratios))

    def relative_change(self, energy: FloatArray) -> float:
        """Largest relative change of the contact by a change of the energy (n_contact,), J/m2, in the steepest part of
        each table that lies ahead: a contact may begin to change later.
        """
        if self.evolution is None:
            return 0.0
        ahead, steepest = self.evolution.energy[1:] > self.evolution.begun[:, None], np.zeros(self.n_contact)
        for table in (found for name in EVOLVING if (found := getattr(self.evolution, name)) is not None):
            slope = np.abs(np.diff(table, axis=1)) / np.diff(self.evolution.energy)
            relative = np.where(ahead, slope / np.minimum(table[:, :-1], table[:, 1:]), 0.0)
            steepest = np.maximum(steepest, relative.max(axis=1))
        return float((steepest * energy)[self.rubs].max(initial=0.0))

    @cached_property
    def has_normal(self) -> BoolArray:
        """False (n_contact,) for pairs without a closing displacement, whose normal force is constant."""
        return np.asarray(self.dofs[:, 0] >= 0)

    @cached_property
    def component_index(self) -> IntArray:
        """`3 pair + component` (n_rel,) of each relative displacement."""
        return np.flatnonzero(self.dofs.ravel() >= 0)

    @cached_property
    def pair_rows(self) -> IntArray:
        """Relative displacement of each component of the pairs (n_contact, 3); -1 where there is none."""
        rows = np.full(self.dofs.size, -1)
        rows[self.component_index] = np.arange(self.component_index.size)
        return rows.reshape(self.dofs.shape)

    @property
    def relative(self) -> IntArray:
        """Indices (n_rel,) of the relative displacements in a `LinearModel`."""
        return self.dofs.ravel()[self.component_index]


@dataclass(frozen=True, eq=False)
class LinearModel(_ByRows):
    """One linear structure with `n` displacements: `M x'' + C x' + K x + (contact forces) = load`, Eq. (1).

    Equal to itself alone, so that what is derived from a structure can be cached by it.

    - mass, damping, stiffness (n, n): real symmetric, or Hermitian for a cyclic sector at one nodal diameter.
    - load_static (n,): N, real.
    - load_harmonic (n,): N per unit excitation amplitude; complex, load(t) = Re(F exp(i w t)).
    - response (n_response, n): matrix from the displacements to the reported responses, m.
    - blade (m, n): of a sector, whose blade may deviate in a ring (`solver.structure.ring`): amplitudes of the modes of
      the blade alone, sqrt(N m), of which `blade^H blade` is the stiffness. None where they are not known.
    """

    mass: Matrix
    damping: Matrix
    stiffness: Matrix
    load_static: FloatArray
    load_harmonic: ComplexArray
    response: Matrix
    blade: Matrix | None = None

    @cached_property
    def conjugate(self) -> "LinearModel":
        """The structure of a harmonic whose nodal diameter is folded back: conjugate matrices, so damping is kept."""
        parts = (self.mass, self.damping, self.stiffness, self.load_static, self.load_harmonic, self.response)
        one = LinearModel(*(np.conj(part) for part in parts))
        return one if self.blade is None else replace(one, blade=np.conj(self.blade))


@dataclass(frozen=True, eq=False, repr=False)
class ReducedModel:
    """A scene: linear structure(s), the contact pairs on them and the names of the responses. Equal to itself alone.

    - linear: structure for each nodal diameter k in 0..n_sectors // 2, with equal indices of the contact displacements;
      the key 0 only for a structure that is no cyclic sector.
    - n_sectors: of the cyclic structure; 0 for none. nodal_diameter: d of the travelling wave that excites the sector;
      harmonic n moves in nodal diameter n d.
    """

    linear: Mapping[int, LinearModel]
    contact: ContactInterface
    response_names: tuple[str, ...]
    n_sectors: int = 0
    nodal_diameter: int = 0

    @property
    def n_repeated(self) -> int:
        """Equal parts that follow each other in the displacements: 1, or the sectors of a ring."""
        return 1

    def harmonic_structure(self, harmonic: int) -> "LinearModel":
        """Linear model in which a harmonic moves: that of nodal diameter `n d` modulo N, conjugate above N/2.

        Raises KeyError where the scene does not have that nodal diameter.
        """
        if self.n_sectors == 0 or self.nodal_diameter == 0:
            return self.linear[0]
        wrapped = (harmonic * self.nodal_diameter) % self.n_sectors
        if 2 * wrapped > self.n_sectors:
            return self.linear[self.n_sectors - wrapped].conjugate
        return self.linear[wrapped]

    def __repr__(self) -> str:
        """Three lines: sizes, contact pairs, responses."""
        contact, words = self.contact, (name or "without a name" for name in dict.fromkeys(self.contact.surface))
        wave = f", nodal diameter {self.nodal_diameter} of {self.n_sectors} sectors" if self.n_sectors else ""
        return (
            f"ReducedModel: {len(self.linear[0].mass)} displacements{wave}\n"
            f"  contact pairs      {contact.n_contact} on {contact.area.sum():.6g} m2, surfaces {', '.join(words)}\n"
            f"  responses          {', '.join(self.response_names)}"
        )

    def has_harmonics(self, n_harmonics: int) -> bool:
        """Whether the scene has the nodal diameters of all harmonics 0..n_harmonics."""
        wanted = needed_nodal_diameters(self.nodal_diameter, self.n_sectors, n_harmonics)
        return all(k in self.linear for k in wanted)


def with_friction(model: ReducedModel, coefficient: ArrayLike | None) -> ReducedModel:
    """The model with the friction coefficient of its pairs, from one number or (n_contact,); None for its own.

    Set once, where a user or a study gives both; what computes reads `contact.friction`.
    Raises ValueError where it is given twice, not at all, or not for each pair.
    """
    own, n_contact = model.contact.friction_coefficient, model.contact.n_contact
    if own is None and coefficient is None:
        raise ValueError("friction_coefficient is missing: the scene has none of its own")
    if own is not None and coefficient is not None:
        raise ValueError("friction_coefficient is given twice: the scene has one of each pair, give None")
    given = np.asarray(coefficient if own is None else own, np.float64)
    if given.shape not in ((), (n_contact,)):
        raise ValueError(f"friction_coefficient has shape {given.shape}: give a number or shape ({n_contact},)")
    return replace(model, contact=replace(model.contact, friction_coefficient=np.full(n_contact, given)))


def needed_nodal_diameters(nodal_diameter: int, n_sectors: int, n_harmonics: int) -> tuple[int, ...]:
    """Folded nodal diameters of the harmonics 0..n_harmonics of a travelling wave, ascending, each once."""
    if n_sectors == 0:
        return (0,)
    wrapped = {(harmonic * nodal_diameter) % n_sectors for harmonic in range(n_harmonics + 1)}
    return tuple(sorted({min(k, n_sectors - k) for k in wrapped}))
