"""Small models for the tests of the solver, all seeded, and the textbook and dovetail scenes at a small size."""

from collections.abc import Sequence
from dataclasses import fields, is_dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.linalg import eigh

from solver.arguments import worn_model
from solver.continuation.first_state import solve_first_state
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import State
from solver.loading_history.start_states import FrequencySweep
from solver.model import ContactInterface, FloatArray, LinearModel, ReducedModel, needed_nodal_diameters, with_friction
from solver.newton.run import Run
from solver.results.history import StartState, WearHistory
from solver.results.state_report import evaluated
from solver.settings import Resolution, SolverSettings, first_resolution
from solver.structure.joint import Case, Joint, build_case
from solver.wear.history import integrate_together
from solver.wear.wearing_joint import WearRequest, steps_of
from studies.scenes import build_scene, scene_parameters
from tests.random_scenes import COMPONENTS, definite

ALL_KINDS = ("3d", "constant_load", "one_tangent", "second_tangent", "normal_only", "constant_load_one_tangent")
STIFFNESS = 1e7  # N/m
MASS = 5.0  # kg
PRELOAD = 100.0  # N on a pair
OMEGA = 600.0  # rad/s, below the first natural frequencies of the random models


def random_contact(random: np.random.Generator, kinds: Sequence[str], n_inner: int) -> ContactInterface:
    """Pairs whose displacements lie scattered among the inner ones."""
    n_contact = len(kinds)
    dofs = np.full((n_contact, 3), -1)
    places = [(pair, component) for pair, kind in enumerate(kinds) for component in COMPONENTS[kind]]
    dofs[tuple(np.transpose(places))] = random.permutation(len(places) + n_inner)[: len(places)]
    return ContactInterface(
        dofs=dofs.astype(np.int64),
        area=random.uniform(0.5e-4, 2e-4, n_contact),
        gap=np.zeros(n_contact),
        normal_load=np.where(dofs[:, 0] < 0, PRELOAD, 0.0),
        position=np.full((n_contact, 3), np.nan),
        surface=("plane",) * n_contact,
    )


def random_linear(
    random: np.random.Generator, contact: ContactInterface, n_inner: int, hermitian: bool = False
) -> LinearModel:
    """Elastic joint with little mass of its own, pressed on its pairs, excited everywhere, damped, two responses."""
    n = int((contact.dofs >= 0).sum()) + n_inner
    stiffness = STIFFNESS * definite(random, n, hermitian)
    load_static = 0.05 * PRELOAD * random.normal(size=n)
    closing = contact.dofs[:, 0]
    load_static[closing[closing >= 0]] += PRELOAD
    response = random.normal(size=(2, n))
    if hermitian:
        response = response + 1j * random.normal(size=(2, n))
    share = np.ones(n)
    share[contact.dofs[contact.dofs >= 0]] = 0.1
    return LinearModel(
        mass=MASS * definite(random, n, hermitian) * np.outer(share, share),
        damping=5e-5 * stiffness,
        stiffness=stiffness,
        load_static=load_static,
        load_harmonic=random.normal(size=n) + 1j * random.normal(size=n),
        response=response,
    )


def random_model(seed: int, kinds: Sequence[str] = ("3d", "3d", "3d"), n_inner: int = 4) -> ReducedModel:
    """Random structure with preloaded pairs."""
    random = np.random.default_rng(seed)
    contact = random_contact(random, kinds, n_inner)
    return ReducedModel({0: random_linear(random, contact, n_inner)}, contact, ("first", "second"))


def with_free_masses(model: ReducedModel, pairs: Sequence[int]) -> ReducedModel:
    """The same structure, with the tangents of some pairs soft and heavy: masses directly on sliders."""
    free = model.contact.dofs[list(pairs), 1:].ravel()
    free = free[free >= 0]

    def scaled(linear: LinearModel) -> LinearModel:
        soft, heavy = np.ones(linear.load_static.size), np.ones(linear.load_static.size)
        soft[free], heavy[free] = 0.02, 10.0
        return replace(
            linear,
            stiffness=linear.stiffness * np.outer(soft, soft),
            damping=linear.damping * np.outer(soft, soft),
            mass=linear.mass * np.outer(heavy, heavy),
        )

    return replace(model, linear={k: scaled(linear) for k, linear in model.linear.items()})


def cyclic_model(
    seed: int, kinds: Sequence[str], n_sectors: int, nodal_diameter: int, n_harmonics: int = 3
) -> ReducedModel:
    """Sector whose structures at different nodal diameters have nothing in common: an index mixed up is seen."""
    random = np.random.default_rng(seed)
    contact = random_contact(random, kinds, 4)
    waves = needed_nodal_diameters(nodal_diameter, n_sectors, n_harmonics)
    linear = {k: random_linear(random, contact, 4, hermitian=k > 0) for k in waves}
    return ReducedModel(linear, contact, ("first", "second"), n_sectors, nodal_diameter)


def random_balance(
    model: ReducedModel,
    settings: SolverSettings,
    seed: int,
    *,
    wear: bool,
    resolution: Resolution | None = None,
    friction: float | None = 0.4,
) -> tuple[Balance, FloatArray]:
    """Balance with a history that is not zero, and a predicted force at which pairs stick, slip and open."""
    random = np.random.default_rng(seed)
    resolution = resolution or first_resolution(settings)
    joint = case_of(model, friction, OMEGA, settings, resolution).joint(OMEGA, 60.0)
    n_contact = model.contact.n_contact
    history = 0.12 * PRELOAD / joint.penalty.tangential[:, None] * random.normal(size=(n_contact, 2))
    history[model.contact.dofs[:, 1:] < 0] = 0.0
    # so much wear in a step that its part of the Jacobian is as large as the others
    gain = random.uniform(0.1, 0.3, n_contact) / PRELOAD if wear else np.zeros(n_contact)
    balance = Balance(joint, history, random.uniform(0.0, 2e-6, n_contact), gain)
    order = np.concatenate([[0], np.repeat(resolution.orders, 2)])
    predicted = random.normal(size=(joint.component_index.size, order.size))
    predicted *= 1.2 * PRELOAD / (1.0 + order) ** 1.5
    predicted[joint.component_index % 3 == 0, 0] += PRELOAD
    return balance, predicted


def scene(name: str, n_harmonics: int = 21, **values: float) -> ReducedModel:
    """A bundled scene with other than the default parameters."""
    return build_scene(name, scene_parameters(name)(**values), n_harmonics)


@lru_cache(maxsize=4)
def dovetail(n_harmonics: int = 3, nodal_diameter: int = 0) -> ReducedModel:
    """The coarse dovetail sector: 16 pairs."""
    return scene("dovetail_sector", n_harmonics, mesh=1, nodal_diameter=nodal_diameter)


def case_of(model, friction, *asked) -> Case:
    """The case of a model with friction; asked: all else of `build_case`."""
    return build_case(with_friction(model, friction), *asked)


def sweep_of(model, friction, *asked) -> FrequencySweep:
    """The sweep of a model with friction; asked: all else of `FrequencySweep`."""
    return FrequencySweep(with_friction(model, friction), *asked)


def branch_states(model, friction, amplitude, omegas, settings, sweep="up") -> list[StartState]:
    """Start states at angular frequencies, rad/s, ascending."""
    frequencies = np.asarray(omegas, float) / (2.0 * np.pi)
    found = dict(sweep_of(model, friction, amplitude, sweep, settings).states(frequencies))
    return [found[index] for index in range(len(omegas))]


def state_at(model, friction, amplitude, omega, settings, sweep="up") -> tuple[StartState, Case, State]:
    """A start state, which must exist, at an angular frequency, rad/s; its case, and the state evaluated."""
    (start,) = branch_states(model, friction, amplitude, [omega], settings, sweep)
    assert start.state is not None
    case = case_of(model, friction, start.penalty_omega, settings, start.resolution)
    return start, case, evaluated(case, start.state)


def worn_state(kinds: Sequence[str], settings: SolverSettings) -> tuple[Joint, State]:
    """A random joint, worn a little, whose pairs stick, slip and open, and its state."""
    worn = np.random.default_rng(1).uniform(0.0, 2e-6, len(kinds))
    case = case_of(worn_model(random_model(1, kinds), worn), 0.4, OMEGA, settings)
    return case.joint(OMEGA, 60.0), first_point(case, OMEGA, 60.0)


def first_point(case: Case, omega: float, amplitude: float) -> State:
    """State found from nothing, which must exist; its parameter is the share 1 of the excitation."""
    point = solve_first_state(case, omega, amplitude, Run(case.settings.tolerance))
    assert isinstance(point, State)
    return point


def march_wear(
    model, friction, start, wear_coefficient, step, scheme, cycles, settings, *, keep=None, resume=None, **asked
) -> WearHistory:
    """The history from a start state; asked: what else `WearRequest` has."""
    wanted = WearRequest(wear_coefficient, steps_of(scheme, step), cycles, **asked)
    return next(integrate_together(with_friction(model, friction), settings, start, (wanted,), keep, resume))


def glued_frequency(model: ReducedModel) -> float:
    """First natural frequency of a model with its joint held, Hz, at the nodal diameter of the excitation."""
    linear = model.harmonic_structure(1)
    inner = np.setdiff1d(np.arange(len(linear.mass)), model.contact.dofs.ravel())
    stiffness, mass = (part[np.ix_(inner, inner)] for part in (linear.stiffness, linear.mass))
    return float(np.sqrt(eigh(stiffness, mass, eigvals_only=True)[0]) / (2.0 * np.pi))


def assert_same(one: Any, other: Any) -> None:
    """Two results are equal to the last bit, but for the time that they took."""
    for name in (entry.name for entry in fields(other) if entry.name != "run_time"):
        mine, its = getattr(one, name), getattr(other, name)
        if is_dataclass(its):
            assert_same(mine, its)
        else:
            np.testing.assert_array_equal(mine, its, name)
