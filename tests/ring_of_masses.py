"""A ring of blades whose shrouds touch, from point masses: all sectors with all contacts, and one sector of a wave."""

import numpy as np

from solver.model import ContactInterface, LinearModel, ReducedModel

N = 6
MASS = np.array([0.5, 0.02, 0.02, 0.02, 0.02])  # kg
LOSS, OMEGA, COUPLING, INCLINED = 2e-3, 1200.0, 2e5, np.radians(30.0)
OVERLAP = 2e-5  # m, of neighbouring shrouds before they are put together
GROUND, BLADE, SHROUD = 2e6, 3e4, (4e6, 1e6)  # N/m
DISK, LEFT, RIGHT = 0, slice(1, 3), slice(3, 5)  # displacements: of the disk around; of each end around and along the axis


def sector() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mass and stiffness (5, 5) of a sector alone, and its unit load (5,).

    A disk moves around the axis. A blade, bent in one inclined direction and stiff in the other, carries both ends of a
    shroud, which springs join.
    """
    stiffness = np.zeros((5, 5))
    stiffness[DISK, DISK] = GROUND
    along = np.array([np.cos(INCLINED), np.sin(INCLINED)])
    bent = BLADE * np.outer(along, along) + 40.0 * BLADE * (np.eye(2) - np.outer(along, along))
    foot = np.array([[1.0], [0.0]])
    for end in (LEFT, RIGHT):
        to_disk = np.zeros((2, 5))
        to_disk[:, end], to_disk[:, :1] = np.eye(2), -foot
        stiffness += to_disk.T @ bent @ to_disk
    between = np.zeros((2, 5))
    between[:, LEFT], between[:, RIGHT] = -np.eye(2), np.eye(2)
    stiffness += between.T @ np.diag(SHROUD) @ between
    load = np.concatenate([[0.0], 0.5 * along, 0.5 * along])
    return np.diag(MASS), stiffness, load


def contacts(n: int) -> ContactInterface:
    """Pairs with a closing displacement and one tangent, pressed by the overlap; their displacements come first."""
    pairs = np.column_stack([2 * np.arange(n), 2 * np.arange(n) + 1, np.full(n, -1)])
    nowhere = np.full((n, 3), np.nan)
    return ContactInterface(pairs, np.full(n, 1e-5), np.full(n, -OVERLAP), np.zeros(n), nowhere, n * ("shroud",))


def structure(mass: np.ndarray, stiffness: np.ndarray, load: np.ndarray, tips: np.ndarray, own: np.ndarray) -> LinearModel:
    """The structure in other displacements, of which `own` gives the old ones. load, tips: the latter in rows."""
    mass, stiffness = (own.conj().T @ each @ own for each in (mass, stiffness))
    return LinearModel(mass, LOSS / OMEGA * stiffness, stiffness, np.zeros(len(mass)), own.conj().T @ load, tips @ own)


def one_sector(diameter: int) -> ReducedModel:
    """The sector of a wave, the right end by its displacement relative to the left end of the next sector."""
    mass, stiffness, load = sector()
    structures = {}
    for k in range(N // 2 + 1):
        own = np.eye(5, dtype=complex)
        own[RIGHT, LEFT] = np.exp(2j * np.pi * k / N) * np.eye(2)
        whole = stiffness.astype(complex)
        whole[DISK, DISK] += 2.0 * COUPLING * (1.0 - np.cos(2.0 * np.pi * k / N))
        excited = load if k == min(diameter, N - diameter) else 0.0 * load
        structures[k] = structure(mass, whole, excited, load[None], own[:, [3, 4, 0, 1, 2]])
    return ReducedModel(structures, contacts(1), ("tip",), N, diameter)


def whole_ring(diameter: int) -> ReducedModel:
    """All sectors and contacts; the right ends by their displacements relative to the left ends of the next sectors."""
    mass, stiffness, load = sector()
    whole, own = np.kron(np.eye(N), stiffness), np.eye(5 * N)
    for j in range(N):
        after = (j + 1) % N
        disks = np.zeros(5 * N)
        disks[5 * j], disks[5 * after] = 1.0, -1.0
        whole += COUPLING * np.outer(disks, disks)
        own[5 * j + 3 : 5 * j + 5, 5 * after + 1 : 5 * after + 3] = np.eye(2)
    relative = (5 * np.arange(N)[:, None] + [3, 4]).ravel()
    others = np.setdiff1d(np.arange(5 * N), relative)
    loads = np.kron(np.exp(2j * np.pi * diameter * np.arange(N) / N), load)
    tips = np.kron(np.eye(N), load)
    linear = structure(np.kron(np.eye(N), mass), whole, loads, tips, own[:, np.concatenate([relative, others])])
    return ReducedModel({0: linear}, contacts(N), tuple(f"tip{j}" for j in range(N)))
