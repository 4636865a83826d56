"""A spring-mounted mass that slides on a rigid support: the textbook case of dry friction.

A spring presses the mass, and wear relaxes the spring: with the wear depth W the normal force is
`N(W) = normal_load - normal_stiffness W` until the pair opens. `contact_stiffness` divides N(W) by
`1 + normal_stiffness / (contact_stiffness area)`. Without wear, damping and contact stiffness, and if the mass never
stops, the motion is that of Den Hartog, Trans. ASME 53 (1931).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from solver.contact.wear_law import ARCHARD, WearingWork, WearLaw, wearing_work
from solver.model import FloatArray, ReducedModel, with_friction
from solver.model_from_matrices import build_model
from studies.scene import Damping, Kilogram, Newton, NewtonPerMetre, Remark, Scene, SquareMetre

_SINGULAR = 1e-9  # 1/r beside an odd number, where G has no bound
_POINTS = 4001  # in a half period, among which the slowest moment of the motion is sought
_STEPS = 64  # at least, from the first cycle to the last
_LEAST_FORCE = 1e-200  # of the first one: any number that can be divided by
_KNOWN = {"scene.worn", *(f"axes.{key}" for key in ("frequency", "wear_coefficient", "excitation_amplitude"))}
_KNOWN |= {f"wear.{key}" for key in ("law", "threshold", "pressure", "depth", "factor", "surfaces")}
"""Keys of a study, beside the parameters of the scene, on which the exact answer depends."""


@dataclass(frozen=True)
class DenHartogSlider:
    """Den Hartog's closed form: a mass on a spring under a harmonic force with rigid Coulomb friction, without stops.

    With r = omega / omega_0, V = 1 / (1 - r^2) and G = tan(pi / (2 r)) / r the amplitude is

        X = sqrt(V^2 - (F_f / F)^2 G^2) F / k.

    From the turn at x = X on the friction force is F_f against the motion for half a period, so that with theta =
    omega t from there, the force F cos(theta + phi), cos(phi) = X k / (F V) and sin(phi) = -(F_f / F) G / V, the first
    harmonic is

        x_1 = X cos(theta) + (F_f / k) (G + 4 V / pi) sin(theta).

    mass, kg; stiffness, N/m; force: amplitude, N; omega: rad/s.
    """

    mass: float
    stiffness: float
    force: float
    omega: float

    @property
    def ratio(self) -> float:
        """r, the frequency over the natural one."""
        return float(self.omega / np.sqrt(self.stiffness / self.mass))

    @cached_property
    def _factors(self) -> tuple[float, float]:
        """V and G."""
        return 1.0 / (1.0 - self.ratio**2), float(np.tan(0.5 * np.pi / self.ratio)) / self.ratio

    def holds(self, friction_force: float) -> bool:
        """Whether the mass never stops under this friction force, N; less friction does not stop it either.

        With tau = omega_0 t from the turn x' = -r X sin(r tau) + (F_f / k) (sin(tau) + r G (cos(r tau) - cos(tau))),
        which has to stay negative until the next turn: X > S F_f / k, S the largest ratio of the two functions of tau.
        """
        if friction_force == 0.0:
            return self.ratio != 1.0
        if abs((1.0 / self.ratio) % 2.0 - 1.0) < _SINGULAR:
            return False
        v, g = self._factors
        square = v**2 - (friction_force / self.force * g) ** 2
        return square > 0.0 and float(np.sqrt(square)) * self.force > self._needed * friction_force

    @cached_property
    def _needed(self) -> float:
        """S; at tau = 0, where spring and force have to overcome the friction, the ratio is 1 / r^2."""
        from scipy.optimize import minimize_scalar  # where it is used: it takes a while to load

        r, (_, g) = self.ratio, self._factors

        def ratio(tau: FloatArray) -> FloatArray:
            return np.asarray((np.sin(tau) + r * g * (np.cos(r * tau) - np.cos(tau))) / (r * np.sin(r * tau)))

        taus = np.linspace(0.0, np.pi / r, _POINTS)[1:-1]
        best = int(np.argmax(ratio(taus)))
        around = (taus[max(best - 1, 0)], taus[min(best + 1, len(taus) - 1)])
        inside = minimize_scalar(lambda tau: -ratio(tau), bounds=around, method="bounded", options={"xatol": 1e-12})
        return max(1.0 / r**2, -float(inside.fun))

    def amplitude(self, friction_force: FloatArray) -> FloatArray:
        """Largest displacement X, m, where the form holds."""
        v, g = self._factors
        return np.asarray(np.sqrt(v**2 - (friction_force / self.force * g) ** 2) * self.force / self.stiffness)

    def first_harmonic(self, friction_force: FloatArray) -> FloatArray:
        """Amplitude of the first harmonic of the displacement, m, where the form holds."""
        v, g = self._factors
        return np.hypot(self.amplitude(friction_force), friction_force / self.stiffness * (g + 4.0 / np.pi * v))

    def wear(
        self, mu: float, load: float, normal_stiffness: float, area: float, work: WearingWork, sliding: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Depth worn since the start, m, and normal force, N, of the only pair, each (n,).

        sliding: s (n,), 1/Pa, wear coefficient times cycle count, ascending from 0 or above. The depth W follows
        `dW/ds = X(S, N / area, W) / area` with the normal force `N = load - k_N W`, the slip work of a cycle
        `S = 4 N X_0(mu N)`, X_0 the amplitude of the motion, and the wearing work X of the law, see
        `solver.contact.wear_law`. With a spring the unknown is z = ln(N / load), `dz/ds = -(k_N / area) X / N`, which
        stays calm.

        mu: friction coefficient. load: at the start, N. normal_stiffness: k_N, N/m; 0 for a constant force. area: m2.
        """

        def rate(force: float, depth: float) -> float:
            """`dW/ds` over the normal force, 1/N m: of the force, N, and the depth, m."""
            slip_work = 4.0 * force * float(self.amplitude(np.array(mu * force)))
            worn = work.work(np.array([slip_work]), np.array([force]), np.array([depth]))
            return float(worn[0]) / force / area

        if load <= 0.0:
            return np.zeros_like(sliding), np.zeros_like(sliding)
        if normal_stiffness <= 0.0:
            return _integrated(lambda depth: rate(load, depth) * load, sliding), np.full_like(sliding, load)
        soft = load / normal_stiffness
        z = _integrated(
            lambda z: -normal_stiffness * rate(load * max(np.exp(z), _LEAST_FORCE), -np.expm1(z) * soft), sliding
        )
        return np.abs(np.expm1(z)) * soft, load * np.exp(z)


def _integrated(rate: Callable[[float], float], sliding: FloatArray) -> FloatArray:
    """The solution y (n,) of `dy/ds = rate(y)`, y(0) = 0, at ascending s (n,) from 0 or above."""
    from scipy.integrate import solve_ivp  # where it is used: it takes a while to load

    found, fastest, later = np.zeros_like(sliding), abs(rate(0.0)), sliding > 0.0
    if fastest > 0.0 and later.any():
        end = float(sliding[-1])
        # between two steps the solution is interpolated, with an error that the tolerance does not bound
        limits = {"rtol": 1e-11, "atol": 1e-13 * fastest * float(sliding[later][0]), "max_step": end / _STEPS}
        wearing = solve_ivp(lambda _, y: [rate(float(y[0]))], (0.0, end), [0.0], "DOP853", sliding[later], **limits)
        found[later] = wearing.y[0]
    return found


class Parameters(Scene):
    """The defaults resonate at 201.3 Hz without friction.

    With 10 N at 160 Hz the mass never stops, and 1e5 cycles at 1.1e-11 1/Pa wear off half of the normal force.
    """

    OFFERS: ClassVar = ("exact",)

    mass: Kilogram = Field(0.1, gt=0, description="mass")
    damping: Damping = Field(0.0, ge=0, description="viscous damping of the mount")
    stiffness: NewtonPerMetre = Field(1.6e5, gt=0, description="tangential stiffness of the mount")
    normal_load: Newton = Field(10.0, gt=0, description="normal force without wear, of a rigid contact")
    normal_stiffness: Annotated[NewtonPerMetre, Remark("0: the normal force is constant")] = Field(
        1e5, ge=0, description="stiffness of the spring that presses"
    )
    area: SquareMetre = Field(1e-4, gt=0, description="contact area")

    def build(self, _: int) -> ReducedModel:
        """The response is the displacement of the mass, on which the load acts.

        With a spring the closing displacement of the pair comes before that of the mass: a massless degree of freedom,
        pressed by `normal_load`.
        """
        mass, damping = np.diag([0.0, self.mass]), np.diag([0.0, self.damping])
        stiffness = np.diag([self.normal_stiffness, self.stiffness])
        sprung = self.normal_stiffness > 0
        own = slice(0 if sprung else 1, None)  # with the closing displacement, or without it
        return build_model(
            mass[own, own],
            damping[own, own],
            stiffness[own, own],
            [[0, 1, -1]] if sprung else [[-1, 0, -1]],
            self.area,
            load_harmonic=np.array([0.0, 1.0])[own],
            load_static=np.array([self.normal_load, 0.0]) if sprung else None,
            response=np.array([[0.0, 1.0]])[:, own],
            normal_load=0.0 if sprung else self.normal_load,
            surface=("support",),
            response_names=("mass",),
        )

    def exact_answer(
        self,
        frequency: float,
        excitation_amplitude: float,
        wear_coefficients: FloatArray,
        cycles: FloatArray,
        law: WearLaw = ARCHARD,
        worn_depth: float = 0.0,
        changed: frozenset[str] = frozenset(),
    ) -> tuple[FloatArray, FloatArray]:
        """Wear and vibration by Den Hartog's closed form and the differential equation of the wear depth.

        The volume worn since the count 0 (n_wear, n_cycles), m3, and the amplitude of the first harmonic of the
        response (n_wear, n_cycles, 1), m. NaN where the form does not hold: the mass stops on its way, the frequency is
        singular, the mount damped, the contact compliant, or it does not know one of the `changed` keys of a study.

        frequency: Hz. excitation_amplitude: N. wear_coefficients (n_wear,): 1/Pa. cycles (n_cycles,): counts.
        worn_depth: m, at the count 0.
        """
        mu, load = self.friction_coefficient, self.normal_load - self.normal_stiffness * worn_depth
        slider = DenHartogSlider(self.mass, self.stiffness, excitation_amplitude, 2.0 * np.pi * frequency)
        # the worn state depends on wear coefficient and cycle count through their product alone
        sliding = np.multiply.outer(wear_coefficients, cycles)
        known = self.damping == 0.0 and self.contact_stiffness is None and changed <= _KNOWN and law.name != "power"
        if not (known and slider.holds(mu * max(load, 0.0))):
            return np.full(sliding.shape, np.nan), np.full((*sliding.shape, 1), np.nan)
        begun, contact = law.begun_at(np.array([worn_depth])), with_friction(self.build(1), mu).contact
        different, places = np.unique(sliding, return_inverse=True)
        work = wearing_work(begun, contact, 1.0)
        depth, force = slider.wear(mu, load, self.normal_stiffness, self.area, work, different)
        response, places = slider.first_harmonic(mu * force), places.reshape(sliding.shape)
        return self.area * depth[places], response[places][..., np.newaxis]
