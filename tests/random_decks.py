"""Random small models of two or three elastic blocks that press on each other, each made from its seed alone.

Drawn are sizes, stiffnesses and meshes of the blocks (matching or not), overhangs, the tilt of the contact faces, gaps
and interference, supports (the lowest block at one end, both or its bottom; another block at its end or not at all),
the friction coefficient (0.01 to 1.2), and a load over four decades that presses, shears or tips.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import linprog

from solver.continuation.first_state import solve_static_state
from solver.harmonic_balance.state import Failure, State
from solver.model import FloatArray, ReducedModel, with_friction
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import SolverSettings
from solver.structure.joint import Joint, build_case
from studies.finite_element.pairing import ContactSurfaces
from studies.finite_element.reduced_joint import build_fe_scene
from studies.finite_element.solid_mesh import Material
from studies.finite_element.structure import FeModel, JointDefinition, ReductionOptions, mean_motion
from studies.finite_element.surfaces import surface_of_faces
from tests.random_scenes import log_uniform
from tests.studies.fe_models.sectors import faces_where
from tests.studies.fe_models.solid_meshes import block, joined

SALT = 1785  # year of Coulomb's "Théorie des machines simples": other seeds of the tests have nothing to do with these
DIRECTIONS = 64  # of the polygons that stand for a friction disc
OMEGA = 2.0 * np.pi * 1000.0  # rad/s; the penalty alone depends on it
NAMED = (Outcome.STATIC_SLIDING, Outcome.STATIC_OPEN)
EXPECTED = {"possible": (Outcome.CONVERGED,), "impossible": NAMED, "at the limit": (Outcome.CONVERGED, *NAMED)}
"""Outcomes that are right where forces can balance the load, where they cannot, and in between."""


@dataclass(frozen=True)
class RandomDeck:
    """A model and its friction coefficient; facts: what was drawn, for a reader of a list of failures."""

    seed: int
    model: ReducedModel
    friction: float
    facts: str


def random_deck(seed: int) -> RandomDeck:
    """The model of a seed."""
    random = np.random.default_rng([SALT, seed])
    friction = log_uniform(random, 0.01, 1.2)
    # what is free stays on faces that are little steeper than friction allows
    tilt = min(1.1 * friction, 0.6) * random.uniform(-1.0, 1.0) if random.random() < 0.5 else 0.0
    fit = str(random.choice(["closed", "gap", "interference"], p=[0.6, 0.2, 0.2]))
    distance = {"closed": 0.0, "gap": 1.0, "interference": -1.0}[fit] * log_uniform(random, 1e-7, 1e-5)
    blocks = [_Block.drawn(random, None)]
    for _ in range(int(random.choice([1, 2], p=[0.7, 0.3]))):
        blocks.append(_Block.drawn(random, blocks[-1], distance))
    mesh = blocks[0].mesh(tilt)
    of_block = [np.zeros(mesh.n_nodes, int)]
    for number, each in enumerate(blocks[1:], start=1):
        own = each.mesh(tilt)
        mesh = joined(mesh, own)
        of_block.append(np.full(own.n_nodes, number))
    owner = np.concatenate(of_block)
    x, _, z = mesh.coordinates.T
    level = z - tilt * x
    contacts, touching = [], np.zeros(mesh.n_nodes, bool)
    for number, (below, above) in enumerate(pairwise(blocks)):
        lower = (owner == number) & (np.abs(level - below.origin[2] - below.size[2]) < 1e-9)
        over = (x > below.origin[0] - 1e-9) & (x < below.origin[0] + below.size[0] + 1e-9)
        upper = (owner == number + 1) & (np.abs(level - above.origin[2]) < 1e-9) & over
        touching |= lower | upper
        faces = [surface_of_faces(mesh, "face", *faces_where(mesh, inside)) for inside in (lower, upper)]
        contacts.append(ContactSurfaces(*faces, tolerance=1e-3, with_gaps=fit != "closed", label=f"contact {number}"))
    held, supports = _supports(random, blocks, owner, x, level)
    top = (owner == len(blocks) - 1) & (np.abs(level - level.max()) < 1e-9) & ~held.any(axis=1)
    load, loads = _load(random, friction, mesh.n_nodes, top, x)
    tip = mean_motion(np.flatnonzero(top), np.array([1.0, 0.0, 0.0]), mesh.n_nodes)
    # a pair needs a node that moves
    held[touching] = False
    joint = JointDefinition(tuple(contacts), held, tip, {"tip": tip})
    model = build_fe_scene(FeModel(mesh, preload=load), joint, ReductionOptions(n_modes=4), 1).model
    facts = f"{len(blocks)} blocks, {model.contact.n_contact} pairs, mu {friction:.3g}, tilt {tilt:.2g}, {fit}"
    return RandomDeck(seed, model, friction, f"{facts} {distance:.1e}, {supports}, {loads}")


@dataclass(frozen=True)
class _Block:
    """A block of `divisions` hexahedra with a corner at `origin` (3,) and edges `size` (3,), m, of a modulus, Pa."""

    origin: FloatArray
    size: FloatArray
    divisions: tuple[int, ...]
    modulus: float

    @classmethod
    def drawn(cls, random: np.random.Generator, below: "_Block | None", distance: float = 0.0) -> "_Block":
        """The lowest block, or one at a distance, m, above another."""
        size = np.array([random.uniform(0.02, 0.05), random.uniform(0.006, 0.02), log_uniform(random, 0.003, 0.015)])
        divisions = tuple(int(n) for n in random.integers((2, 1, 2), (5, 3, 4)))
        modulus = log_uniform(random, 5e9, 2.1e11)
        if below is None:
            return cls(np.zeros(3), size, divisions, modulus)
        place = below.origin + [0.0, 0.0, below.size[2] + distance]
        if random.random() < 0.4:
            matching = (below.divisions[0], below.divisions[1], divisions[2])
            return cls(place, np.array([*below.size[:2], size[2]]), matching, modulus)
        size[1] = below.size[1] * random.uniform(0.5, 1.0)
        # half of the first element or more of them lie on the block below
        place[0] += random.uniform(0.0, 1.0 - 1.0 / divisions[0]) * below.size[0] * 0.7
        size[0] = min(size[0], divisions[0] * (below.origin[0] + below.size[0] - place[0]))
        return cls(place, size, divisions, modulus)

    def mesh(self, tilt: float):
        """Mesh of the block, whose horizontal planes are tilted."""

        def shape(points: FloatArray) -> FloatArray:
            placed = self.origin + points * self.size
            placed[:, 2] += tilt * placed[:, 0]
            return placed

        return block("C3D8I", self.divisions, shape, Material(self.modulus, 0.3, 7800.0))[0]


def _supports(random, blocks, owner, x, level) -> tuple[np.ndarray, str]:
    """Displacements (n_nodes, 3) that are held, and what was drawn."""
    held = np.zeros((len(owner), 3), bool)
    kind = str(random.choice(["one end", "both ends", "bottom"]))
    lowest = owner == 0
    if kind == "bottom":
        held[lowest & (np.abs(level) < 1e-9)] = True
    else:
        held[lowest & (x < 1e-9)] = True
    if kind == "both ends":
        held[lowest & (x > blocks[0].size[0] - 1e-9)] = True
    upper = ["free"] * (len(blocks) - 1)
    for number in range(1, len(blocks)):
        if random.random() < 0.4:
            upper[number - 1] = "held"
            own = owner == number
            held[own & (x > x[own].max() - 1e-9)] = True
    return held, f"{kind} and {', '.join(upper)}"


def _load(random, friction, n_nodes, top, x) -> tuple[np.ndarray, str]:
    """Nodal forces (3 n_nodes,), N, on the top face, and what was drawn."""
    force = log_uniform(random, 0.1, 1000.0)
    shear = 0.0 if random.random() < 0.4 else random.uniform(0.0, 1.2) * friction
    turn = random.uniform(0.0, 2.0 * np.pi)
    direction = np.array([shear * np.cos(turn), shear * np.sin(turn), -1.0])
    nodes, where = np.flatnonzero(top), "all over"
    if random.random() < 0.3:
        low, high = x[nodes].min(), x[nodes].max()
        nodes, where = nodes[x[nodes] > low + 0.6 * (high - low)], "at one end"
    return mean_motion(nodes, direction, n_nodes) * force, f"{force:.3g} N, shear {shear:.2g} {where}"


def equilibrium_possible(stiffness: FloatArray, force: FloatArray, friction: float) -> bool | None:
    """Whether contact forces within Coulomb's cones can balance a load on the parts that nothing else holds.

    stiffness (3n, 3n), force (3n,): condensed on the relative displacements, pair by pair normal and two tangents.
    The motions without stiffness are those of rigid parts: a linear programme in the contact forces. True with all
    forces within the cones, False without a balance even in wider cones, None between (a load just above an edge).
    """
    values, vectors = np.linalg.eigh(stiffness)
    rigid = vectors[:, values < 1e-9 * values[-1]]
    if not rigid.shape[1]:
        return True
    angle = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    scale = np.abs(force).max()

    def balanced(radius: float, least: float) -> bool:
        # each pair: non-negative shares of the forces (1, mu cos, mu sin) on the edges of its cone
        edges = np.stack([np.ones(DIRECTIONS), radius * np.cos(angle), radius * np.sin(angle)])
        n_pairs = len(force) // 3
        shares = np.einsum("pcr,cd->rpd", rigid.reshape(n_pairs, 3, -1), edges).reshape(rigid.shape[1], -1)
        weights, bounds = np.ones(shares.shape[1]), (least, None)
        return linprog(weights, A_eq=shares, b_eq=rigid.T @ force / scale, bounds=bounds).status == 0

    if balanced(0.98 * friction, 1e-5):
        return True
    return None if balanced(1.02 * friction, 0.0) else False


def law_errors(joint: Joint, point: State) -> dict[str, float]:
    """How far a static state is off each law, from its displacements, forces and history alone, relative.

    Lengths are relative to the largest displacement or gap, forces to the largest force.
    """
    at = point.evaluation
    force, moved, friction = at.force_h[:, :, 0], at.displacement_h[:, :, 0], joint.contact.friction
    gap = joint.contact.gap + at.wear_depth
    condensed = joint.structure
    largest_force = max(np.abs(force).max(), np.abs(condensed.force_h[:, 0]).max(), 1e-300)
    length = max(np.abs(moved).max(), np.abs(gap).max(), 1e-300)
    normal, tangential = force[:, 0], np.linalg.norm(force[:, 1:], axis=1)
    slip = moved[:, 1:] - at.start_history
    slid, limit = np.linalg.norm(slip, axis=1), friction * normal
    closed = normal > 0.0
    out_of_balance = condensed.static_stiffness @ moved.ravel() + force.ravel() - condensed.force_h[:, 0]
    # an open pair may slide; a closed one slides at its limit alone, along the friction force
    off_limit = np.where(closed, slid * (limit - tangential), 0.0)
    off_direction = np.where(closed, slid * tangential - np.einsum("ij,ij->i", slip, force[:, 1:]), 0.0)
    return {
        "tension": float(max(-normal.min(), 0.0) / largest_force),
        "penetration": float(max((moved[:, 0] - gap).max(), 0.0) / length),
        "force across a gap": float((normal * np.abs(moved[:, 0] - gap)).max() / largest_force / length),
        "friction beyond its limit": float(max((tangential - limit).max(), 0.0) / largest_force),
        "slip below the limit": float(np.abs(off_limit).max() / largest_force / length),
        "slip in another direction": float(np.abs(off_direction).max() / largest_force / length),
        "equilibrium": float(np.abs(out_of_balance).max() / largest_force),
    }


def run_deck(deck: RandomDeck) -> tuple[str, Outcome, dict[str, float]]:
    """Whether there is a static state (a key of `EXPECTED`), what the solver says, and the errors of the laws."""
    settings = SolverSettings()
    joint = build_case(with_friction(deck.model, deck.friction), OMEGA, settings).joint(OMEGA, 0.0)
    structure = joint.structure
    possible = equilibrium_possible(structure.static_stiffness, structure.force_h[:, 0], deck.friction)
    exists = {True: "possible", False: "impossible", None: "at the limit"}[possible]
    point = solve_static_state(joint, Run(settings.tolerance))
    if isinstance(point, Failure):
        return exists, point.outcome, {}
    return exists, Outcome.CONVERGED, law_errors(joint, point)


def static_forces(model: ReducedModel, friction: float | None) -> FloatArray:
    """Contact forces (n_contact, 3), N, of the static state, in which all laws hold: compression positive."""
    joint = build_case(with_friction(model, friction), OMEGA, SolverSettings()).joint(OMEGA, 0.0)
    point = solve_static_state(joint, Run(1e-9))
    assert isinstance(point, State), f"no static state at a friction coefficient of {friction}"
    errors = law_errors(joint, point)
    assert max(errors.values()) < 1e-7, errors
    return point.evaluation.force_h[:, :, 0]
