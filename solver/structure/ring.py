"""A ring of sectors that may differ: the structure of all sectors beside that of one.

Sector s of N is seen at its own time, `theta = w t + 2 pi d s / N` for an excitation of engine order d, so that under a
travelling wave equal sectors move alike. With the matrices A_k of nodal diameter k the structure of harmonic n has in
sectors i and j the block

    1/N sum_k exp(2 pi i (i - j) (k - n d) / N) A_k,

so that a motion exp(2 pi i s q / N) over the sectors, its wave q, moves with the matrix of nodal diameter n d + q. With
the blade-alone frequency of sector s higher by the fraction delta_s, and the amplitudes a_s of the blade's modes
(`LinearModel.blade`), its stiffness has `(2 delta_s + delta_s^2) a_s^H a_s` more.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from solver.model import (
    EVOLVING,
    ComplexArray,
    ContactInterface,
    Evolution,
    FloatArray,
    IntArray,
    LinearModel,
    Matrix,
    ReducedModel,
)
from solver.outcome import check

LARGEST_DEVIATION = 0.2
"""Of a blade-alone frequency. Blades of one disk differ by a few percent."""

_MATRICES = ("mass", "damping", "stiffness", "response")


class RingStructure(LinearModel):
    """All sectors in one harmonic, as a `LinearModel` whose matrices are assembled where they are asked for.

    - waves (N,): the sector's structure in each wave.
    - stiffening (N,): `2 delta + delta^2`. driven (N,): load of each sector over the sector's.
    """

    waves: tuple[LinearModel, ...]
    stiffening: FloatArray
    driven: FloatArray

    def __init__(self, waves: tuple[LinearModel, ...], stiffening: FloatArray, driven: FloatArray) -> None:
        for name, value in (("waves", waves), ("stiffening", stiffening), ("driven", driven)):
            object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        """A matrix or load of all sectors, computed once; what no `LinearModel` has is an AttributeError."""
        value: Any
        if name in _MATRICES:
            value = over_sectors(self.stacked(name), real=self.is_real)
            if name == "stiffness" and self.deviates:
                blade = over_sectors(self.stacked("blade"), real=self.is_real)
                strong = np.repeat(self.stiffening, len(blade) // len(self.waves))
                value = value + blade.conj().T @ (strong[:, None] * blade)
        elif name == "load_static":
            value = np.tile(np.real(self.waves[0].load_static), len(self.waves))
        elif name == "load_harmonic":
            value = over_sectors(self.stacked("load_harmonic")[:, :, None]) @ self.driven.astype(complex)
        else:
            raise AttributeError(name)
        self.__dict__[name] = value
        return value

    @property
    def deviates(self) -> bool:
        """Whether blades differ."""
        return bool(self.stiffening.any())

    @property
    def is_real(self) -> bool:
        """Whether the matrices of all sectors are real: those of harmonics that all sectors see at one time."""
        first, last = self.waves[1 % len(self.waves)], self.waves[-1]
        return first is last or np.array_equal(first.stiffness, np.conj(last.stiffness))

    def stacked(self, name: str) -> ComplexArray:
        """A part of the sector's structure in all waves, (N, ...); kept, as it is small beside that of all sectors."""
        parts: dict[str, ComplexArray] = self.__dict__.setdefault("_stacked", {})
        if name not in parts:
            parts[name] = np.asarray([getattr(wave, name) for wave in self.waves], np.complex128)
        return parts[name]

    @cached_property
    def conjugate(self) -> "RingStructure":
        """As in `LinearModel`."""
        # the conjugate of wave q is wave -q
        folded = tuple(self.waves[-place].conjugate for place in range(len(self.waves)))
        return RingStructure(folded, self.stiffening, self.driven)


def over_sectors(of_waves: ComplexArray, *, real: bool = False) -> Matrix:
    """Matrix (N a, N b) of all sectors from those of the waves (N, a, b); real: of harmonics that are so."""
    n, a, b = of_waves.shape
    blocks: Matrix = np.fft.ifft(of_waves, axis=0)
    blocks = blocks.real if real else blocks
    apart = (np.arange(n)[:, None] - np.arange(n)) % n
    return np.ascontiguousarray(blocks[apart].transpose(0, 2, 1, 3).reshape(n * a, n * b))


class _Structures(Mapping[int, LinearModel]):
    """The ring's structure in a harmonic n by `n d` modulo N, folded; each is made once."""

    def __init__(self, sector: ReducedModel, stiffening: FloatArray, driven: FloatArray) -> None:
        self.sector, self.given, self.made = sector, (stiffening, driven), dict[int, RingStructure]()

    def __getitem__(self, shift: int) -> RingStructure:
        if not 0 <= shift <= self.sector.n_sectors // 2:
            raise KeyError(shift)
        if shift not in self.made:
            n = self.sector.n_sectors
            waves = tuple(_of_diameter(self.sector, (shift + wave) % n) for wave in range(n))
            self.made[shift] = RingStructure(waves, *self.given)
        return self.made[shift]

    def __iter__(self) -> Iterator[int]:
        return iter(range(self.sector.n_sectors // 2 + 1))

    def __len__(self) -> int:
        return self.sector.n_sectors // 2 + 1


def _of_diameter(sector: ReducedModel, k: int) -> LinearModel:
    """The sector's structure in nodal diameter k, 0 to N - 1."""
    return sector.linear[k] if 2 * k <= sector.n_sectors else sector.linear[sector.n_sectors - k].conjugate


@dataclass(frozen=True, eq=False, repr=False)
class RingModel(ReducedModel):
    """All sectors of a ring, pairs and responses sector by sector. sector: of the tuned ring, without deviations."""

    sector: ReducedModel | None = None

    def assembled(self) -> ReducedModel:
        """The ring with the full matrices of all sectors, for what changes them, as the equations of a mode do."""
        shifts = self.linear if self.nodal_diameter else (0,)
        linear = {}
        for shift in shifts:
            one = self.linear[shift]
            parts = one.mass, one.damping, one.stiffness, one.load_static, one.load_harmonic, one.response
            linear[shift] = LinearModel(*parts)
        return ReducedModel(linear, self.contact, self.response_names, self.n_sectors, self.nodal_diameter)

    @property
    def tuned(self) -> ReducedModel:
        """The sector."""
        assert self.sector is not None
        return self.sector

    @property
    def n_repeated(self) -> int:
        """As in `ReducedModel`."""
        return self.n_sectors

    @cached_property
    def phase_steps(self) -> int:
        """Equal steps in which the phases of all sectors divide a period."""
        return self.n_sectors // int(np.gcd(self.n_sectors, self.nodal_diameter)) if self.nodal_diameter else 1

    @cached_property
    def phase_of_pairs(self) -> IntArray:
        """Phase (n_contact,) of each pair's sector before that of the first one, in `phase_steps` of a period."""
        sectors = np.repeat(np.arange(self.n_sectors), self.contact.n_contact // self.n_sectors)
        step = self.nodal_diameter * self.phase_steps // self.n_sectors
        return np.asarray(sectors * step % self.phase_steps)


def build_ring(model: ReducedModel, deviation: ArrayLike = 0.0, *, forced_sector: int | None = None) -> RingModel:
    """All sectors of a model of one cyclic sector, with contact pairs and responses sector by sector.

    Friction, wear depths and all other values of pairs of the ring are then (n_sectors * n_contact,). Responses have
    the names of the sector's with the number of their sector, from 0 on.

    deviation: of the blade-alone frequency of each sector, one number or (n_sectors,), relative.
    forced_sector: the only one whose blade is excited; by default each one is, by the travelling wave.
    Raises ValueError where the model is no sector, lacks a nodal diameter, or the modes of its blade.
    """
    n = model.n_sectors
    check("model", n >= 2, "give a model of one cyclic sector")
    lacking = [k for k in range(n // 2 + 1) if k not in model.linear]
    check(f"model: it lacks nodal diameters {lacking}", not lacking, f"give all from 0 to {n // 2}")
    given = np.broadcast_to(np.asarray(deviation, np.float64), (n,)) if np.ndim(deviation) == 0 else deviation
    deviations = np.asarray(given, np.float64)
    right = deviations.shape == (n,) and bool((np.abs(deviations) <= LARGEST_DEVIATION).all())
    check("deviation", right, f"give {n} numbers between -{LARGEST_DEVIATION} and {LARGEST_DEVIATION}")
    known = not deviations.any() or all(each.blade is not None for each in model.linear.values())
    check("deviation: the model has no modes of its blade", known, "give `blade` of each nodal diameter")
    driven = np.ones(n)
    if forced_sector is not None:
        check(f"forced_sector is {forced_sector}", 0 <= forced_sector < n, f"give 0 to {n - 1}")
        check("forced_sector", model.nodal_diameter == 0, "give a sector of nodal diameter 0")
        driven = np.eye(n)[forced_sector]
    structures = _Structures(model, 2.0 * deviations + deviations**2, driven)
    names = tuple(f"{name} {sector}" for sector in range(n) for name in model.response_names)
    contact = _of_all_sectors(model.contact, n, len(model.linear[0].load_static))
    return RingModel(structures, contact, names, n, model.nodal_diameter, model)


def _of_all_sectors(contact: ContactInterface, n: int, n_displacements: int) -> ContactInterface:
    """The pairs of n sectors, one sector after the other."""

    def each(values: Any) -> Any:
        return None if values is None else np.tile(values, (n,) + (1,) * (np.ndim(values) - 1))

    shifts = n_displacements * np.arange(n)[:, None, None]
    evolution = contact.evolution
    if evolution is not None:
        tables = {name: each(getattr(evolution, name)) for name in EVOLVING}
        evolution = Evolution(evolution.energy, **tables, begun=each(evolution.begun))
    places = contact.n_contact * np.arange(n)
    return ContactInterface(
        dofs=np.where(contact.dofs < 0, -1, contact.dofs + shifts).reshape(-1, 3),
        area=each(contact.area),
        gap=each(contact.gap),
        normal_load=each(contact.normal_load),
        position=each(contact.position),
        surface=contact.surface * n,
        friction_coefficient=each(contact.friction_coefficient),
        edge=each(contact.edge),
        # the laws of a scene are dataclasses that know their pairs
        laws=tuple(
            replace(law, pairs=tuple(pair + int(first) for pair in law.pairs))  # type: ignore[type-var]
            for first in places
            for law in contact.laws
        ),
        evolution=evolution,
    )
