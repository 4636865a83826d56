"""Rings with all their sectors: blades of point masses whose shrouds touch, and the ring of any travelling wave."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from solver.model import ContactInterface, FloatArray, LinearModel, ReducedModel

N = 6
MASS = np.array([0.5, 0.04, 0.04, 0.005, 0.005, 0.005, 0.005])  # kg
LOSS, OMEGA, COUPLING, INCLINED = 2e-3, 1200.0, 2e5, np.radians(75.0)
OVERLAP = 4e-5  # m, of neighbouring shrouds before they are put together
GROUND, BLADE, SHROUD = 2e6, 4e4, (1e6, 4e5)  # N/m
# displacements of the disk around the axis; of the tip of the blade and of both ends of its shroud around and along it
DISK, TIP, LEFT, RIGHT = 0, slice(1, 3), slice(3, 5), slice(5, 7)


def sector(deviation: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Mass and stiffness (7, 7) of a sector alone, its unit load (7,), and rows (2, 7) with the stiffness of its blade.

    A disk moves around the axis. A blade, bent in one inclined direction and stiff in the other, carries a shroud.
    """
    along = np.array([np.cos(INCLINED), np.sin(INCLINED)])
    bent = BLADE * np.outer(along, along) + 40.0 * BLADE * (np.eye(2) - np.outer(along, along))
    stiffness, load = np.zeros((7, 7)), np.zeros(7)
    stiffness[DISK, DISK], load[TIP] = GROUND, along
    foot = np.zeros((2, 7))
    foot[:, TIP], foot[0, DISK] = np.eye(2), -1.0
    blade = np.linalg.cholesky(bent).T @ foot
    stiffness += (1.0 + deviation) ** 2 * blade.T @ blade
    for end in (LEFT, RIGHT):
        arm = np.zeros((2, 7))
        arm[:, TIP], arm[:, end] = -np.eye(2), np.eye(2)
        stiffness += arm.T @ np.diag(SHROUD) @ arm
    return np.diag(MASS), stiffness, load, blade


def contacts(n: int) -> ContactInterface:
    """Pairs with a closing displacement and one tangent, pressed by the overlap; their displacements come first."""
    pairs = np.column_stack([2 * np.arange(n), 2 * np.arange(n) + 1, np.full(n, -1)])
    nowhere = np.full((n, 3), np.nan)
    return ContactInterface(pairs, np.full(n, 1e-5), np.full(n, -OVERLAP), np.zeros(n), nowhere, n * ("shroud",))


def structure(forms: tuple[np.ndarray, ...], load: np.ndarray, tips: np.ndarray, own: np.ndarray) -> LinearModel:
    """The structure in other displacements, of which `own` gives the old ones. forms: mass, stiffness, damping."""
    mass, stiffness, damping = (own.conj().T @ form @ own for form in forms)
    return LinearModel(mass, damping, stiffness, np.zeros(len(mass)), own.conj().T @ load, tips @ own)


def one_sector(diameter: int) -> ReducedModel:
    """The sector of a wave, the right end by its displacement relative to the left end of the next sector."""
    mass, stiffness, load, blade = sector()
    structures = {}
    for k in range(N // 2 + 1):
        own = np.eye(7, dtype=complex)
        own[RIGHT, LEFT] = np.exp(2j * np.pi * k / N) * np.eye(2)
        whole = stiffness.astype(complex)
        whole[DISK, DISK] += 2.0 * COUPLING * (1.0 - np.cos(2.0 * np.pi * k / N))
        own = own[:, [5, 6, 0, 1, 2, 3, 4]]
        one = structure((mass, whole, LOSS / OMEGA * whole), load, load[None], own)
        structures[k] = replace(one, blade=blade @ own)
    return ReducedModel(structures, contacts(1), ("tip",), N, diameter)


def whole_ring(diameter: int, deviation: Sequence[float] = N * (0.0,)) -> ReducedModel:
    """All sectors and contacts; the right ends by their displacements relative to the left ends of the next sectors.

    deviation (N,): of the frequency of each blade, with the damping of the equal ones.
    """
    mass, stiffness, load, _ = sector()
    whole, own = np.kron(np.eye(N), stiffness), np.eye(7 * N)
    for j in range(N):
        after = (j + 1) % N
        disks = np.zeros(7 * N)
        disks[7 * j], disks[7 * after] = 1.0, -1.0
        whole += COUPLING * np.outer(disks, disks)
        own[7 * j + 5 : 7 * j + 7, 7 * after + 3 : 7 * after + 5] = np.eye(2)
    damping = LOSS / OMEGA * whole
    for j, other in enumerate(deviation):
        at = slice(7 * j, 7 * j + 7)
        whole[at, at] += sector(other)[1] - stiffness
    relative = (7 * np.arange(N)[:, None] + [5, 6]).ravel()
    others = np.setdiff1d(np.arange(7 * N), relative)
    loads = np.kron(np.exp(2j * np.pi * diameter * np.arange(N) / N), load)
    tips = np.kron(np.eye(N), load)
    linear = structure(
        (np.kron(np.eye(N), mass), whole, damping), loads, tips, own[:, np.concatenate([relative, others])]
    )
    return ReducedModel({0: linear}, contacts(N), tuple(f"tip{j}" for j in range(N)))


def ring_of_sectors(model: ReducedModel) -> ReducedModel:
    """All sectors of a travelling wave that move differently, as one real model with n times the pairs.

    A wave of nodal diameter d on N sectors repeats after n = N / gcd(N, d) of them. With the matrices A_k of the nodal
    diameters k = 0, d, 2 d ... the structure has in sectors i and j the block
    1/n sum_m exp(2 pi i m (i - j) d / N) A_(m d), which is real, as A_(-k) is the conjugate of A_k. The responses are
    those of the first sector, which comes first. Raises KeyError where the scene does not hold a nodal diameter.
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
