"""Random small scenes of every kind that the solver takes, each made from its seed alone.

What a scene may be: 1 to 8 pairs of any kinds; displacements of a pair that are massless, carry a little mass or the
mass itself; with or without inner displacements; gaps closed, open within or beyond reach; preload from none to large;
friction 0 to 2; light to heavy damping; excited from quasi-statically to above the resonances, from micro-slip to gross
slip and lifting.

What it may not be, because there physics itself gives no periodic answer (never because the solver fails):

- every motion has stiffness and damping: free bodies fly off, undamped ones never forget their start;
- a mass that sits directly on a closing displacement stays pressed on (its normal force varies by less than its mean,
  judged with the tangents held and free) or its pair is out of reach: a rigid body that hits a rigid support needs a
  law of restitution, which no scene has. Its area is so large that wear does not lift it either. Masses behind an
  elastic joint may lift and hit;
- friction stays below the coefficient at which a pair without mass snaps: where closing and sliding are coupled so that
  `mu |K_NT| > K_TT` there are loads under which no rate of slip exists (Klarbring, "Examples of non-uniqueness and
  non-existence of solutions to quasistatic contact problems with friction", Ing. Arch. 56 (1990)), and a displacement
  without mass would have to jump;
- where pairs may lift or hit, the modal damping is at least 1 %: lighter vibro-impact has ranges without any stable
  motion of the period of the excitation.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from solver.model import ContactInterface, FloatArray, LinearModel, ReducedModel
from solver.settings import Scheme
from solver.structure.schur import condense

SALT = 1931  # Den Hartog's year: other seeds of the tests have nothing to do with these
COMPONENTS = {
    "3d": (0, 1, 2),
    "one_tangent": (0, 1),
    "second_tangent": (0, 2),
    "normal_only": (0,),
    "constant_load": (1, 2),
    "constant_load_one_tangent": (1,),
}
N_STEPS = 5


@dataclass(frozen=True)
class RandomScene:
    """A case ready to be solved. friction: coefficient. amplitude: N. wear_coefficient: 1/Pa. step, cycles: cycles.

    facts: what was drawn, for a reader of a list of failures.
    """

    seed: int
    model: ReducedModel
    friction: float
    amplitude: float
    frequency_hz: float
    wear_coefficient: float
    step: float
    cycles: float
    scheme: Scheme
    facts: str


@dataclass(frozen=True)
class _Pairs:
    """What was drawn for the pairs: kind, mount ("massless", "light", "direct") and fit of each (n_contact,).

    fit: "pressed", "touching" (no preload), "near" (open, within reach), "far" (never reached).
    preload (n_contact,): N, that the contact takes up with all pressed pairs held. dofs (n_contact, 3).
    """

    kinds: np.ndarray
    mounts: np.ndarray
    fits: np.ndarray
    preload: FloatArray
    dofs: np.ndarray

    @property
    def closing(self) -> np.ndarray:
        """Whether each has a closing displacement."""
        return self.dofs[:, 0] >= 0

    @property
    def pressed(self) -> np.ndarray:
        """Displacements of the pressed pairs."""
        chosen = self.dofs[self.fits == "pressed"]
        return chosen[chosen >= 0]


def log_uniform(random: np.random.Generator, low: float, high: float) -> float:
    """Number whose logarithm is uniform."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def random_scene(seed: int) -> RandomScene:
    """The scene of a seed."""
    random = np.random.default_rng([SALT, seed])
    k0 = log_uniform(random, 1e5, 1e8)
    omega_0 = 2.0 * np.pi * log_uniform(random, 30.0, 1000.0)
    n_inner = int(random.choice([0, 1, 2, 3, 4, 6], p=[0.2, 0.15, 0.2, 0.2, 0.15, 0.1]))
    friction = 0.0 if random.random() < 0.08 else log_uniform(random, 0.01, 2.0)
    pairs = _draw_pairs(random, n_inner, k0 * log_uniform(random, 1e-6, 1e-4))
    n, n_contact = int((pairs.dofs >= 0).sum()) + n_inner, len(pairs.kinds)
    mass, stiffness = _matrices(random, pairs, n, k0, k0 / omega_0**2)
    friction = min(friction, 0.9 * _snapping_friction(stiffness, pairs.dofs))
    severity = log_uniform(random, 0.03, 10.0)
    lifts = np.isin(pairs.fits, ("near", "touching")).any()
    ratio = log_uniform(random, 1e-2 if lifts or severity > 0.5 else 3e-4, 0.2)
    share = random.uniform()
    damping = 2.0 * ratio * (share / omega_0 * stiffness + (1.0 - share) * omega_0 * mass)
    load = _harmonic_load(random, pairs.dofs, n, n_inner)
    omega = _draw_frequency(random, mass, stiffness, pairs.pressed, 5.0 * omega_0)
    full = stiffness + 1j * omega * damping - omega**2 * mass
    amplitude = _amplitude(pairs, full, load, max(friction, 0.05), severity)
    # see the module: a rigid mass must not be lifted by wear either, which goes with 1 / area
    rigid = (pairs.mounts == "direct") & pairs.closing
    area = np.where(rigid, 1e4, 1.0) * 1e-4 * np.array([log_uniform(random, 1e-2, 1e2) for _ in pairs.kinds])
    gap, normal_load = _gaps(random, pairs, full, amplitude * load), np.where(pairs.closing, 0.0, pairs.preload)
    nowhere = np.full((n_contact, 3), np.nan)
    contact = ContactInterface(pairs.dofs, area, gap, normal_load, nowhere, ("random",) * n_contact)
    load_static = _static_load(random, pairs, n, friction)
    linear = LinearModel(mass, damping, stiffness, load_static, load, random.normal(size=(2, n)) / np.sqrt(n))
    cycles = log_uniform(random, 1e3, 1e6)
    wear = _wear_coefficient(random, area, pairs, full, amplitude * load, cycles)
    kinds = ", ".join("/".join(three) for three in zip(pairs.kinds, pairs.mounts, pairs.fits, strict=True))
    facts = f"{n_inner} inner; {kinds}; mu {friction:.3g}, damping {ratio:.2g}, severity {severity:.2g}"
    return RandomScene(
        seed=seed,
        model=ReducedModel({0: linear}, contact, ("first", "second")),
        friction=friction,
        amplitude=amplitude,
        frequency_hz=omega / (2.0 * np.pi),
        wear_coefficient=wear,
        step=cycles / N_STEPS,
        cycles=cycles,
        scheme="implicit" if random.random() < 0.7 else "explicit",
        facts=f"{facts}, rate {omega / omega_0:.3g}",
    )


def _draw_pairs(random: np.random.Generator, n_inner: int, preload: float) -> _Pairs:
    """preload: N, typical of the scene."""
    n = int(random.integers(1, 9))
    kinds = random.choice(list(COMPONENTS), n)
    if random.random() < 0.4:
        kinds[:] = kinds[0]
    # without inner displacements the pairs carry the mass; one at least has to
    shares = [0.45, 0.35, 0.2] if n_inner else [0.3, 0.2, 0.5]
    mounts = random.choice(["massless", "light", "direct"], n, p=shares)
    if not n_inner and "direct" not in mounts:
        mounts[0] = "direct"
    shares = [1.0, 0.0, 0.0, 0.0] if random.random() < 0.55 else [0.5, 0.15, 0.2, 0.15]
    fits = random.choice(["pressed", "touching", "near", "far"], n, p=shares)
    fits[(mounts == "direct") & (fits == "touching")] = "pressed"
    fits[(mounts == "direct") & (fits == "near")] = "far"
    fits[[0 not in COMPONENTS[kind] for kind in kinds]] = "pressed"
    large = 100.0 if random.random() < 0.15 else 1.0
    sizes = np.where(fits == "pressed", large * preload * random.uniform(0.3, 1.7, n), 0.0)
    places = [(pair, component) for pair, kind in enumerate(kinds) for component in COMPONENTS[kind]]
    dofs = np.full((n, 3), -1, np.int64)
    dofs[tuple(np.transpose(places))] = random.permutation(len(places) + n_inner)[: len(places)]
    return _Pairs(kinds, mounts, fits, sizes, dofs)


def _matrices(
    random: np.random.Generator, pairs: _Pairs, n: int, k0: float, m0: float
) -> tuple[FloatArray, FloatArray]:
    """Mass and stiffness: an inner body on springs, the pairs on it by springs, to ground and to each other."""
    inner, relative = np.setdiff1d(np.arange(n), pairs.dofs), pairs.dofs[pairs.dofs >= 0]
    mass, stiffness = np.zeros((n, n)), np.zeros((n, n))
    if inner.size:
        mass[np.ix_(inner, inner)] = m0 * definite(random, inner.size)
        stiffness[np.ix_(inner, inner)] = k0 * definite(random, inner.size)
    if random.random() < 0.5:
        # neighbours on one elastic body: closing and sliding are coupled
        stiffness[np.ix_(relative, relative)] += 0.3 * k0 * definite(random, relative.size)
    for row, mount in zip(pairs.dofs, pairs.mounts, strict=True):
        joint = k0 * log_uniform(random, 0.3, 30.0)
        ground = k0 * log_uniform(random, 0.01, 1.0)
        own = m0 * {"massless": 0.0, "light": 1e-3 * joint / k0, "direct": log_uniform(random, 0.1, 2.0)}[mount]
        for dof in row[row >= 0]:
            tie = np.zeros(n)
            tie[dof] = 1.0
            if inner.size:
                direction = random.normal(size=inner.size)
                tie[inner] = -direction / np.linalg.norm(direction)
            stiffness += joint * np.outer(tie, tie)
            stiffness[dof, dof] += ground
            mass[dof, dof] += own
    return mass, stiffness


def definite(random: np.random.Generator, size: int, complex_values: bool = False) -> np.ndarray:
    """Positive definite matrix with eigenvalues of about 0.5 to 4."""
    root = random.normal(size=(size, size)) / np.sqrt(size)
    if complex_values:
        root = root + 1j * random.normal(size=(size, size)) / np.sqrt(size)
    matrix = root @ root.conj().T + 0.5 * np.eye(size)
    return (matrix + matrix.conj().T) / 2


def _motion(full: np.ndarray, load: np.ndarray, held: np.ndarray) -> np.ndarray:
    """Complex displacements (n,), m, of the structure with some held."""
    free, motion = np.setdiff1d(np.arange(len(load)), held), np.zeros(len(load), complex)
    motion[free] = np.linalg.solve(full[np.ix_(free, free)], load[free])
    return motion


def _snapping_friction(stiffness: FloatArray, dofs: np.ndarray) -> float:
    """Smallest friction coefficient at which a pair snaps, the others held or free; infinite without coupling."""
    relative = np.sort(dofs[dofs >= 0])
    held = condense(stiffness, relative, np.zeros(len(stiffness))).stiffness
    free = np.linalg.inv(held)
    smallest = np.inf
    for row in dofs:
        normal, tangents = np.searchsorted(relative, row[0]), np.searchsorted(relative, row[1:][row[1:] >= 0])
        if row[0] < 0 or tangents.size == 0:
            continue
        coupling = np.linalg.norm(held[normal, tangents])
        yielding = np.linalg.norm(free[normal, tangents])
        if coupling > 0.0:
            own = np.linalg.eigvalsh(held[np.ix_(tangents, tangents)])[0]
            # of one pair, free: K_TT / K_NT of its own stiffness is C_NN / C_NT of its compliance
            smallest = min(smallest, own / coupling, free[normal, normal] / max(yielding, 1e-300))
    return float(smallest)


def _harmonic_load(random: np.random.Generator, dofs: np.ndarray, n: int, n_inner: int) -> np.ndarray:
    """On the inner displacements, complex in every second scene; on the pairs too where there are few others."""
    load = random.normal(size=n) + 1j * (random.random() < 0.5) * random.normal(size=n)
    if n_inner and random.random() < 0.7:
        load[dofs[dofs >= 0]] = 0.0
    return load / np.linalg.norm(load)


def _draw_frequency(
    random: np.random.Generator, mass: FloatArray, stiffness: FloatArray, held: np.ndarray, highest: float
) -> float:
    """Angular frequency, rad/s, quasi-static to above the resonances, these with the pressed pairs held or free.

    highest: rad/s, of a resonance that counts: those of the light masses on the joint, about 30 times the others, do
    not. Excited there they would be rigid bodies that hit.
    """
    everything = np.arange(len(mass))
    natural = _natural_frequencies(mass, stiffness, np.setdiff1d(everything, held))
    if natural.size == 0 or natural[0] > highest or random.random() < 0.4:
        natural = _natural_frequencies(mass, stiffness, everything)
    natural = natural[natural <= max(highest, natural[0])]
    low, high = [(0.01, 0.2), (0.2, 0.9), (0.95, 1.05), (1.1, 3.0)][int(random.choice(4, p=[0.2, 0.3, 0.3, 0.2]))]
    return float(log_uniform(random, low, high) * natural[min(int(random.integers(0, 2)), natural.size - 1)])


def _natural_frequencies(mass: FloatArray, stiffness: FloatArray, free: np.ndarray) -> FloatArray:
    """Natural angular frequencies, rad/s, ascending, with all displacements but the free ones held."""
    if not mass[np.ix_(free, free)].any():
        return np.zeros(0)
    compliance = eigh(mass[np.ix_(free, free)], stiffness[np.ix_(free, free)], eigvals_only=True)
    return np.sort(1.0 / np.sqrt(compliance[compliance > 1e-9 * compliance[-1]]))


def _amplitude(pairs: _Pairs, full: np.ndarray, load: np.ndarray, friction: float, severity: float) -> float:
    """Amplitude, N, at which the worst pair, if it stuck, would reach `severity` times its friction limit (if none has
    a tangent: its preload); less where normal forces would vary too much: see the module.
    """
    dofs, preload = pairs.dofs, pairs.preload
    reference = np.where(preload > 0.0, preload, 0.3 * max(preload.max(), 1e-6 * abs(full).max()))
    pressed = pairs.fits == "pressed"
    if not pressed.any():
        pressed[:] = True

    def forces_on(held: np.ndarray) -> np.ndarray:
        """Amplitudes (n_contact, 3), N, of what holds the displacements (n_contact, 3) of the pressed pairs."""
        held = held & (dofs >= 0) & pressed[:, None]
        forces = np.zeros(dofs.shape)
        forces[held] = abs(condense(full, dofs[held], load).force)
        return forces

    stuck = forces_on(dofs >= 0)
    tangent = np.linalg.norm(stuck[:, 1:], axis=1)
    share = tangent / (friction * reference) if tangent.any() else stuck[:, 0] / reference
    amplitude = severity / share.max()
    if (pressed & pairs.closing).any():
        largest = np.maximum(stuck, forces_on(np.array([True, False, False])))[:, 0]
        allowed = np.where(pairs.mounts == "direct", 0.5, 3.0) * reference
        varies = largest > 0.0
        amplitude = min(amplitude, *(allowed[varies] / largest[varies]))
    return float(amplitude)


def _gaps(random: np.random.Generator, pairs: _Pairs, full: np.ndarray, load: np.ndarray) -> FloatArray:
    """Gaps, m: "near" ones within the motion that the structure would have with its pressed pairs held."""
    gaps, motion = np.where(pairs.fits == "far", 1.0, 0.0), _motion(full, load, pairs.pressed)
    for pair in np.flatnonzero(pairs.fits == "near"):
        gaps[pair] = random.uniform(0.2, 1.2) * abs(motion[pairs.dofs[pair, 0]])
    return gaps


def _static_load(random: np.random.Generator, pairs: _Pairs, n: int, friction: float) -> FloatArray:
    """Presses the pairs on, with a little shear, or so much that some slip before anything vibrates."""
    load = np.zeros(n)
    shear = 1.5 if random.random() < 0.3 else 0.3
    for row, preload in zip(pairs.dofs, pairs.preload, strict=True):
        if row[0] >= 0:
            load[row[0]] = preload
        for dof in row[1:][row[1:] >= 0]:
            load[dof] = random.uniform(-shear, shear) * friction * preload
    return load


def _wear_coefficient(
    random: np.random.Generator, area: FloatArray, pairs: _Pairs, full: np.ndarray, load: np.ndarray, cycles: float
) -> float:
    """Wear coefficient, 1/Pa, that takes between a hundredth and half of the preload of a typical sliding pair away."""
    dofs, needed = pairs.dofs, []
    motion = _motion(full, load, dofs[pairs.closing & (pairs.preload > 0.0), 0])
    worn = log_uniform(random, 0.01, 0.5)
    for pair, row in enumerate(dofs):
        slip = np.linalg.norm(motion[row[1:][row[1:] >= 0]])
        if pairs.preload[pair] > 0.0 and slip > 0.0:
            depth = worn * pairs.preload[pair] / (abs(full[row[0], row[0]]) if row[0] >= 0 else abs(full).max())
            needed.append(depth * area[pair] / (pairs.preload[pair] * 4.0 * slip * cycles))
    return float(np.median(needed)) if needed else 1e-11
