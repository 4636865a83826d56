"""Scenes whose periodic motions are known exactly, and the errors of automatic states against them.

Structures with one contact pair: the textbook scenes, and random ones of any size and unit. Then a cantilever.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from solver import build_model
from solver.harmonic_balance.dlft import Evaluation
from solver.model import ReducedModel
from solver.outcome import Outcome
from solver.results.history import StartState, WearHistory
from solver.results.state_report import evaluated, periodic_motion
from solver.settings import SolverSettings
from solver.structure.joint import Joint
from tests.cantilever import FRICTION, Cantilever
from tests.contact_pair import ContactPair
from tests.event_driven import Orbit
from tests.random_scenes import log_uniform as _spread
from tests.solver.models import branch_states, case_of, march_wear


@dataclass(frozen=True)
class Scene(ContactPair):
    """A structure with a contact pair, for the exact motion and for the solver. excitation: N, of the harmonic load."""

    excitation: float

    @property
    def model(self) -> ReducedModel:
        """The same for the solver; its responses are those of the masses."""
        dofs = [-1 if index is None else index for index in (self.normal, self.tangent, None)]
        loads = {"load_static": self.load_static, "load_harmonic": np.asarray(self.load_harmonic) / self.excitation}
        more = loads | {"gap": self.gap, "normal_load": self.normal_load, "response": self.massive}
        return build_model(self.mass, self.damping, self.stiffness, [dofs], 1.0, **more)

    def orbit_next_to(self, joint: Joint, at: Evaluation) -> Orbit:
        """The exact motion next to a state. Raises NoPeriodicMotionError."""
        motion = periodic_motion(joint, at)
        return self.orbit_near(motion.displacement_t[:, 0], motion.velocity_t[:, 0])


@dataclass(frozen=True)
class Found:
    """What the solver finds, and the relative errors of complex first harmonics and slip work; NaN without a state."""

    history: WearHistory
    response: float = np.nan
    wear_rate: float = np.nan

    @property
    def told(self) -> tuple[float, float]:
        """The estimates of both errors."""
        return float(self.history.response_error[0]), float(self.history.wear_rate_error[0])

    @property
    def safe(self) -> bool:
        """Whether each estimate is at least half of the error; what is exact has the estimate zero."""
        errors = zip(self.told, (self.response, self.wear_rate), strict=True)
        return all(told >= 0.5 * true - 1e-10 for told, true in errors)


def find(scene: Scene, settings: SolverSettings, sweep: str = "up") -> Found:
    """Solve, and compare with the exact motion next to what is found. Raises NoPeriodicMotionError."""
    asked = scene.model, scene.friction
    (start,) = branch_states(*asked, scene.excitation, [scene.omega], settings, sweep)
    # the wear rate is the slip work
    history = march_wear(*asked, start, 1.0, 1.0, "implicit", np.zeros(1), settings)
    if history.outcome is not Outcome.CONVERGED or start.state is None:
        return Found(history)
    case = case_of(*asked, start.penalty_omega, settings, start.resolution)
    state = evaluated(case, start.state)
    orbit = scene.orbit_next_to(state.joint(case), state.evaluation)
    exact, slip_work = scene.response(orbit), scene.slip_work(orbit)
    apart = float(np.linalg.norm(history.response[0] - exact) / np.linalg.norm(exact))
    return Found(history, apart, abs(float(history.wear_rate[0]) - slip_work) / (slip_work or 1.0))


# --- random scenes ---


def _units(random: np.random.Generator) -> tuple[float, float, float]:
    """Stiffness, N/m, mass, kg, and excitation, N."""
    stiffness, mass, force = (_spread(random, 1e-3, 1e3) for _ in range(3))
    return stiffness, mass, force


def slider(random: np.random.Generator, lowest: float = 0.5, highest: float = 1.5) -> Scene:
    """Den Hartog's slider, pressed by a constant force or by a spring; often next to its resonance, often undamped."""
    k, m, force = _units(random)
    ratio = random.uniform(lowest, highest)
    if lowest < 1.0 < highest and random.random() < 0.25:
        ratio = 1.0 + random.choice([-1.0, 1.0]) * _spread(random, 2e-3, 0.05)
    damping = random.choice([0.0, random.uniform(0.0, 0.2)]) * np.sqrt(k * m)
    friction = random.choice([0.1, 0.5, 1.0])
    load = random.uniform(0.05, 0.8) * force / friction
    return slid(m, damping, k, load, friction, force, ratio * np.sqrt(k / m), random.choice([0.0, k]))


def slid(mass, damping, stiffness, load, friction, force, omega, pressing=0.0, swing=0.0) -> Scene:
    """A mass on a slider. pressing: stiffness, N/m, of a spring at the pair, or 0. swing: harmonic part of the normal
    force, N, which takes a spring.
    """
    normal = pressing > 0.0
    places = slice(0 if normal else 1, None)
    parts = (np.diag(both)[places, places] for both in ((0.0, mass), (0.0, damping), (pressing, stiffness)))
    static, harmonic = np.array([load if normal else 0.0, 0.0]), np.array([swing, force])
    pair = (0, 1, 0.0) if normal else (None, 0, load)
    return Scene(*parts, static[places], harmonic[places], *pair, 0.0, friction, omega, force)


def stopping_slider(random: np.random.Generator) -> Scene:
    """So slow that it stops, or stops several times in half a period."""
    return slider(random, 0.15, 0.5)


def swinging_slider(random: np.random.Generator) -> Scene:
    """Slider whose normal force swings, out of phase with the motion, and may leave it free."""
    k, m, force = _units(random)
    friction = random.choice([0.2, 0.6])
    load = random.uniform(0.05, 0.7) * force / friction
    swing = load * random.uniform(0.0, 1.5) * np.exp(2j * np.pi * random.random())
    damping, omega = random.uniform(0.01, 0.16) * np.sqrt(k * m), random.uniform(0.4, 1.6) * np.sqrt(k / m)
    return slid(m, damping, k, load, friction, force, omega, k * _spread(random, 0.1, 100.0), swing)


def two_masses(random: np.random.Generator) -> Scene:
    """Chain of two masses, friction on the second, about both of its resonances."""
    k, m, force = _units(random)
    share, other = _spread(random, 0.3, 3.0), _spread(random, 0.3, 3.0)
    mass, stiffness = m * np.diag([1.0, share]), k * np.array([[1.0 + other, -other], [-other, other]])
    natural = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real))
    damping = 2.0 * random.uniform(0.005, 0.04) / natural[0] * stiffness
    omega = random.choice(natural) * random.uniform(0.6, 1.3)
    load = random.uniform(0.05, 0.8) * force / 0.5
    return Scene(mass, damping, stiffness, np.zeros(2), force * np.eye(2)[0], None, 1, load, 0.0, 0.5, omega, force)


def wall(ratio: float, gap: float, damping: float, stiffness: float, phase: float = 0.0) -> Scene:
    """Mass before an elastic wall, all in units of the mount. gap: in static deflections. damping: share of critical.
    phase: rad, of the excitation.
    """
    matrices = np.diag([0.0, 1.0]), np.diag([0.0, 2.0 * damping])
    spring = np.array([[stiffness, -stiffness], [-stiffness, stiffness + 1.0]])
    load = np.array([0.0, np.exp(1j * phase)])
    return Scene(*matrices, spring, np.zeros(2), load, 0, None, 0.0, gap, 0.0, ratio, 1.0)


def impact(random: np.random.Generator) -> Scene:
    """Vibro-impact: behind a gap, without one, or pressed on the wall."""
    gap = random.choice([0.0, -_spread(random, 0.05, 2.0), _spread(random, 0.1, 10.0), _spread(random, 0.1, 10.0)])
    return wall(random.uniform(0.3, 2.5), gap, _spread(random, 0.01, 0.2), _spread(random, 5.0, 300.0))


def grazing(random: np.random.Generator) -> Scene:
    """The mass without the wall would just touch it, or just not."""
    ratio, damping = random.uniform(0.3, 1.8), _spread(random, 0.01, 0.2)
    free = 1.0 / abs(1.0 - ratio**2 + 2j * damping * ratio)
    gap = free * (1.0 - random.choice([-1.0, 1.0, 1.0, 1.0]) * _spread(random, 1e-5, 0.1))
    return wall(ratio, gap, damping, _spread(random, 5.0, 300.0), random.uniform(0.0, 2.0 * np.pi))


def behind_spring(tangential, damping, limit, omega, force=1.0, units=1.0) -> Scene:
    """Jenkins' element on a mass, its mount of stiffness 1 N/m and the mass 1 kg, all forces and stiffnesses times
    `units`. damping: N s/m. limit: of friction, N.
    """
    matrices = units * np.diag([0.0, 1.0]), units * np.diag([0.0, damping])
    spring = units * np.array([[tangential, -tangential], [-tangential, 1.0 + tangential]])
    load = units * np.array([0.0, force])
    return Scene(*matrices, spring, np.zeros(2), load, None, 0, units * limit / 0.4, 0.0, 0.4, omega, units)


def jenkins(random: np.random.Generator) -> Scene:
    """Elastic dry friction about its two resonances."""
    tangential = _spread(random, 0.1, 30.0)
    omega = random.uniform(0.8, 1.2) * random.choice([1.0, np.sqrt(1.0 + tangential)])
    damping, limit = random.uniform(0.002, 0.1), _spread(random, 0.1, 5.0)
    return behind_spring(tangential, damping, limit, omega, 1.0, _spread(random, 1e-3, 1e3))


def barely_slipping(tangential, damping, omega, over, phase=0.7) -> Scene:
    """Elastic dry friction whose limit is exceeded by a share `over` if it sticks. phase: rad, of the excitation."""
    stuck = tangential / abs(1.0 + tangential - omega**2 + 1j * omega * damping)
    return behind_spring(tangential, damping, stuck * (1.0 - over), omega, np.exp(1j * phase))


def slipping_little(random: np.random.Generator) -> Scene:
    """Elastic dry friction next to the onset of slip."""
    tangential, damping = _spread(random, 0.1, 30.0), random.uniform(0.01, 0.1)
    omega = random.uniform(0.3, 1.5) * np.sqrt(1.0 + tangential)
    over = random.choice([-1.0, 1.0, 1.0, 1.0]) * _spread(random, 1e-4, 0.2)
    return barely_slipping(tangential, damping, omega, over, 2.0 * np.pi * random.random())


def inclined(random: np.random.Generator) -> Scene:
    """Mass in the plane on inclined mounts, pressed on an elastic pair: slip, stick and separation at once."""
    k, m, force = _units(random)
    tangential, normal = k * _spread(random, 0.3, 30.0), k * _spread(random, 0.3, 30.0)
    angle = random.uniform(0.0, np.pi)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    mount = k * turn @ np.diag([1.0, _spread(random, 0.3, 4.0)]) @ turn.T
    stiffness, damping = np.zeros((4, 4)), np.zeros((4, 4))
    stiffness[:2, :2], stiffness[2:, 2:] = np.diag([normal, tangential]), mount + np.diag([tangential, normal])
    stiffness[0, 3] = stiffness[3, 0] = -normal
    stiffness[1, 2] = stiffness[2, 1] = -tangential
    low, high = (np.sqrt(np.linalg.eigvalsh(of / m)) for of in (mount, stiffness[2:, 2:]))
    damping[2:, 2:] = random.uniform(0.02, 0.1) / low[0] * mount + 0.02 * np.sqrt(k * m) * np.eye(2)
    load = np.array([0.0, 0.0, 0.0, _spread(random, 0.3, 20.0) * force])
    share = random.uniform(0.0, 1.0)
    harmonic = force * np.array([0.0, 0.0, np.sqrt(1.0 - share**2), share * np.exp(2j * np.pi * random.random())])
    omega = random.uniform(0.5 * low[0], 1.2 * high[1])
    mass = np.diag([0.0, 0.0, m, m])
    return Scene(mass, damping, stiffness, load, harmonic, 0, 1, 0.0, 0.0, random.uniform(0.2, 0.6), omega, force)


_DRAWS = (slider, stopping_slider, swinging_slider, two_masses, impact, grazing, jenkins, slipping_little, inclined)
KINDS = {draw.__name__.replace("_", " "): draw for draw in _DRAWS}


def drawn(kind: str, seed: int) -> Scene:
    """A scene of a kind."""
    return KINDS[kind](np.random.default_rng([seed, sorted(KINDS).index(kind)]))


def textbook_scenes() -> dict[str, tuple[Scene, str]]:
    """By name: the scene, and the sweep that leads to its state."""
    found = {}
    # force, N, against 5 N of friction; frequency ratio
    sliders = [(10.0, ratio) for ratio in (0.5, 0.6, 0.9, 1.1, 1.4)] + [(7.0, 0.8), (7.0, 1.25)]
    for force, ratio in (*sliders, (5.5, 0.6), (5.5, 0.8), (5.5, 1.25)):
        found[f"slider {force} N {ratio}"] = slid(0.1, 0.0, 1.6e5, 10.0, 0.5, force, ratio * np.sqrt(1.6e6)), "up"
    damping, stiffness = np.array([[0.04, -0.02], [-0.02, 0.02]]), np.array([[2.0, -1.0], [-1.0, 1.0]])
    for omega in (0.3, 0.4, 0.5, 0.6, 0.7, 1.3, 1.6, 1.8):
        parts = np.eye(2), damping, stiffness, np.zeros(2), np.array([20.0, 0.0])
        found[f"two masses {omega}"] = Scene(*parts, None, 1, 14.4, 0.0, 0.5, omega, 20.0), "up"
    for omega, sweep in ((1.05, "up"), (1.1, "up"), (1.2, "up"), (1.5, "up"), (1.2, "down")):
        branch = "upper" if sweep == "up" else "open"
        found[f"vibro-impact {omega} {branch}"] = wall(omega, 5.0, 0.025, 100.0), sweep
    return found


SPRINGS = {"rigid": np.inf, "soft spring": 20.0, "stiff spring": 200.0}  # N/m


@lru_cache
def exact_tip(name: str, force: float, omega: float) -> tuple[complex, float]:
    """First harmonic and largest displacement of the tip, m."""
    beam = Cantilever(spring=SPRINGS[name])
    orbit, tip = beam.orbit(force, omega), beam.tip_of_orbit()
    first = sum(share * orbit.harmonic(dof) for dof, share in enumerate(tip))
    return complex(first), float(np.abs(tip @ orbit.sample(4096)[: tip.size]).max())


def tip_errors(name: str, force: float, omega: float, settings: SolverSettings) -> tuple[StartState, list[float]]:
    """An unworn state, and the relative errors of what is reported of its tip."""
    model = Cantilever(spring=SPRINGS[name]).model()
    (start,) = branch_states(model, FRICTION, force, [omega], settings)
    history = march_wear(model, FRICTION, start, 0.0, 1.0, "explicit", np.zeros(1), settings)
    found = history.response[0, 0], history.response_peak[0, 0]
    return start, [float(abs(own / true - 1.0)) for own, true in zip(found, exact_tip(name, force, omega), strict=True)]
