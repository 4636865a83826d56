"""Wear laws. Each law is Archard's law with another work in place of the slip work.

The wear depth of a pair grows in a cycle by, Eqs. (2), (7), (21),

    g = k_w / alpha * X,      X = c f(p, W) max(S - q alpha, 0)

with the area of the pair alpha, m2, and the *wearing work* X, J: a function of the slip work S, J, the integral over a
period of lambda_N |dX_T|, the mean pressure over the period p, Pa, and the depth W, m:

- `archard`: X = S.
- `energy`: c = mu, so that X = mu S is the energy dissipated by friction. k_w is then the energy wear coefficient,
  volume over dissipated energy (Fouvry, Liskiewicz, Kapsa, Hannel, Sauger, Wear 255 (2003) 287).
- `threshold`: only slip work above a density q, J/m2 per cycle, wears.
- `table`: f is given at pressures and depths, with bilinear interpolation and constant extrapolation.
- `power`: c = mu as in `energy`, and f falls with the power density of friction, phi = mu S nu / alpha, W/m2, at the
  frequency nu: `f = r + (1 - r) exp(-d phi)`. Oxide protects a slow contact less: k_w is that without power, r k_w that
  at much (Arnaud, Fouvry and others 2021, "abrasive" and "adhesive").

In each law c may differ between surfaces. In all but `power` the rate is proportional to k_w. An implicit step of h
cycles solves `W = W_k + gain X(S, p, W)`, Eq. (24), with the gain `h k_w / alpha` (the print of (26b) lacks h), pair by
pair.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.model import ContactInterface, FloatArray
from solver.outcome import check

LAWS = ("archard", "energy", "threshold", "table", "power")


@dataclass(frozen=True)
class WearTable:
    """Factors of the wear coefficient, 1: a row for each pressure, Pa, a column for each depth, m, both ascending."""

    pressure: tuple[float, ...]
    depth: tuple[float, ...]
    factor: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class PowerTerms:
    """How the wear coefficient falls with the power density of friction.

    adhesive: energy wear coefficient at much power, 1/Pa; at none it is that of the history. decay: d, m2/W.
    """

    adhesive: float
    decay: float


@dataclass(frozen=True)
class WearLaw:
    """A wear law in the terms of a study.

    - name: one of `LAWS`. threshold: q, J/m2 per cycle. table: f, of the laws "table" and "power".
    - surfaces: factor of the wear coefficient for each label of a surface; a pair "flat/cylinder" has the sum of both.
      Empty: factor 1 for each pair.
    - worn: depth of each pair at the start of a history, m, from which the depths of the law "table" count; empty: 0.

    Raises ValueError where the name is another one, or `table` does not fit it.
    """

    name: str = "archard"
    threshold: float = 0.0
    table: WearTable | PowerTerms | None = None
    surfaces: tuple[tuple[str, float], ...] = ()
    worn: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        check("law", self.name in LAWS, f'give one of {", ".join(LAWS)} instead of "{self.name}"')
        taken = {"table": WearTable, "power": PowerTerms}.get(self.name, type(None))
        remedy = 'give table = WearTable(...) to the law "table", PowerTerms(...) to "power", to no other'
        check("law", isinstance(self.table, taken), remedy)

    def begun_at(self, depth: FloatArray) -> WearLaw:
        """The law of a history that begins at depths (n_contact,), m; only the factors of a table depend on depths."""
        return replace(self, worn=tuple(depth.tolist())) if self.name == "table" else self


ARCHARD = WearLaw()


def surface_factors(labels: tuple[str, ...], surfaces: tuple[tuple[str, float], ...]) -> FloatArray:
    """Factor (n_contact,) of each pair: the sum of the factors of the surfaces in its label.

    Raises ValueError where a surface has no factor, or where a factor belongs to no surface of the pairs.
    """
    given = dict(surfaces)
    sides = [label.split("/") for label in labels]
    known = dict.fromkeys(side for each in sides for side in each)
    for name in (*given, *known):
        if name not in known or name not in given:
            raise ValueError(f'"{name}": give a factor to each of the surfaces {", ".join(known)}, and to no other')
    return np.array([sum(given[side] for side in each) for each in sides])


@dataclass(frozen=True)
class PairFactors:
    """The factors f of the law "table" for the pairs of a joint, with bilinear interpolation.

    pressure (n_p,), Pa, depth (n_d,), m, factor (n_p, n_d): the table. area (n_contact,): alpha, m2.
    worn (n_contact,): depth at the depth 0 of the history, m.
    """

    pressure: FloatArray
    depth: FloatArray
    factor: FloatArray
    area: FloatArray
    worn: FloatArray | float = 0.0

    def at_pressure(self, normal_force: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rows of the table at the pressures of the pairs (n_contact, n_d), and derivative to the normal force, 1/N."""
        place, fraction, width = _between(self.pressure, normal_force / self.area)
        low, high = self.factor[place], self.factor[np.minimum(place + 1, len(self.pressure) - 1)]
        slope = np.divide(1.0, width * self.area, out=np.zeros_like(width), where=width > 0.0)
        return low + fraction[:, None] * (high - low), slope[:, None] * (high - low)

    def at_depth(self, by_depth: FloatArray, depth: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values of rows (n_contact, n_d) at the depths of the pairs, m, and their derivatives, 1/m."""
        place, fraction, width = _between(self.depth, depth + self.worn)
        pairs = np.arange(depth.size)
        low, high = by_depth[pairs, place], by_depth[pairs, np.minimum(place + 1, len(self.depth) - 1)]
        slope = np.divide(high - low, width, out=np.zeros_like(width), where=width > 0.0)
        return low + fraction * (high - low), slope

    def at(self, normal_force: FloatArray, depth: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Factor of each pair (n_contact,), and its derivatives by normal force, 1/N, and depth, 1/m."""
        by_depth, by_depth_slope = self.at_pressure(normal_force)
        value, slope = self.at_depth(by_depth, depth)
        return value, self.at_depth(by_depth_slope, depth)[0], slope


def _between(knots: FloatArray, at: FloatArray) -> tuple[np.ndarray, FloatArray, FloatArray]:
    """Index of the knot before each value, fraction of the interval, and its width; both are 0 beyond the ends."""
    place = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(knots) - 1)
    width = np.append(np.diff(knots), 0.0)[place]
    width = np.where(at < knots[0], 0.0, width)
    fraction = np.divide(at - knots[place], width, out=np.zeros_like(width), where=width > 0.0)
    return place, fraction, width


@dataclass(frozen=True)
class PowerFactors:
    """The factors f of the law "power" for the pairs of a joint.

    rest: r, 1. per_work (n_contact,): d phi over the work of friction, 1/J, at `frequency`, Hz.
    """

    rest: float
    per_work: FloatArray
    frequency: float = 1.0

    def at(self, work: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Factor of each pair (n_contact,) at a work of friction, J; and derivative of factor times work by work."""
        power = self.per_work * work
        falling = (1.0 - self.rest) * np.exp(-power)
        return self.rest + falling, self.rest + falling * (1.0 - power)


@dataclass(frozen=True)
class WearingWork:
    """The wearing work of the pairs of one joint.

    surface (n_contact,): c of the surfaces, 1. least (n_contact,): q alpha, J. table, power: f; None for 1.
    friction (n_contact,): mu, a factor of c; None in laws without it.
    """

    surface: FloatArray | float = 1.0
    least: FloatArray | float = 0.0
    table: PairFactors | None = None
    power: PowerFactors | None = None
    friction: FloatArray | None = None

    @property
    def factor(self) -> FloatArray | float:
        """C (n_contact,), 1."""
        return self.surface if self.friction is None else self.surface * self.friction

    def _reduced(self, slip_work: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Factor f of the law "power" (n_contact,), and derivative of factor times work by work; 1 in other laws."""
        if self.power is None or self.friction is None:
            return np.ones_like(slip_work), np.ones_like(slip_work)
        return self.power.at(self.friction * slip_work)

    def rubbing(self, friction: FloatArray) -> WearingWork:
        """The wearing work with other friction coefficients (n_contact,)."""
        if self.friction is None or np.array_equal(friction, self.friction):
            return self
        return replace(self, friction=friction)

    def at(self, frequency: float) -> WearingWork:
        """The wearing work at a frequency, Hz."""
        if self.power is None or self.power.frequency == frequency:
            return self
        per_work = self.power.per_work * (frequency / self.power.frequency)
        return replace(self, power=replace(self.power, per_work=per_work, frequency=frequency))

    @property
    def largest_factor(self) -> float:
        """Largest possible ratio of wearing work to slip work, 1."""
        most = 1.0 if self.power is None else max(1.0, self.power.rest)
        return float(np.max(self.factor)) * (most if self.table is None else float(self.table.factor.max()))

    def work(self, slip_work: FloatArray, normal_force: FloatArray, depth: FloatArray) -> FloatArray:
        """Wearing work X (n_contact,), J, from slip work, J, mean normal force, N, and depth, m, each (n_contact,)."""
        work = self._without_table(slip_work)
        return work if self.table is None else work * self.table.at(normal_force, depth)[0]

    def slopes(
        self, slip_work: FloatArray, normal_force: FloatArray, depth: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Derivatives (n_contact,) of `work` by slip work, 1, normal force, m, and depth, N."""
        by_work, none = np.where(slip_work >= self.least, self.factor, 0.0), np.zeros_like(slip_work)
        by_work = by_work * self._reduced(slip_work)[1]
        if self.table is None:
            return by_work, none, none
        work, (value, by_force, by_depth) = self._without_table(slip_work), self.table.at(normal_force, depth)
        return by_work * value, work * by_force, work * by_depth

    def by_friction(self, slip_work: FloatArray) -> FloatArray:
        """Derivative (n_contact,), J, of `work` by the friction coefficient, at constant slip work."""
        if self.friction is None:
            return np.zeros_like(slip_work)
        return np.asarray(self.surface * slip_work * self._reduced(slip_work)[1])

    def amplification(self, slip_work: FloatArray, normal_force: FloatArray, depth: FloatArray) -> float:
        """Ratio of the relative errors of total wearing work and slip work, at least 1; above 1 near a threshold, and
        where much power leaves nearly no wear.
        """
        worn = float(self.work(slip_work, normal_force, depth).sum())
        if not (np.any(self.least) or self.power) or worn <= 0.0:
            return 1.0
        return max(float(np.abs(self.slopes(slip_work, normal_force, depth)[0]) @ slip_work) / worn, 1.0)

    def growth(
        self, gain: FloatArray | float, slip_work: FloatArray, normal_force: FloatArray, before: FloatArray
    ) -> FloatArray:
        """Growth of the depth (n_contact,), m, in a step: the least root y of `y = gain X(S, p, before + y)`.

        gain (n_contact,): `h k_w / alpha` of the step, m/J. before (n_contact,): depth at the start of the step, m.
        Between two depths of the table both sides are straight lines, so that the root is exact.
        """
        steep, table = gain * self._without_table(slip_work), self.table
        if table is None:
            return steep
        by_depth, _ = table.at_pressure(normal_force)
        # y - gain X at the growth y = 0 and at the growths that reach the depths of the table
        now = table.at_depth(by_depth, before)[0][:, None]
        grown = np.maximum(table.depth[None, :] - (before + table.worn)[:, None], 0.0)
        values = np.concatenate([now, np.where(grown > 0.0, by_depth, now)], axis=1)
        grown = np.concatenate([np.zeros_like(now), grown], axis=1)
        excess = grown - steep[:, None] * values
        passed, pairs = excess[:, 1:] >= 0.0, np.arange(before.size)
        place = np.argmax(passed, axis=1)
        (low, high), (begin, end) = ((part[pairs, place], part[pairs, place + 1]) for part in (excess, grown))
        fraction = np.divide(-low, high - low, out=np.zeros_like(low), where=high > low)
        return np.where(passed.any(axis=1), begin + fraction * (end - begin), steep * by_depth[:, -1])

    def growth_tangent(
        self,
        gain: FloatArray | float,
        at: tuple[FloatArray, FloatArray, FloatArray],
        tangents: tuple[FloatArray, FloatArray],
        pushed: FloatArray,
    ) -> FloatArray:
        """Derivative (n_contact, k) of the growth from the derivatives (n_contact, k) of slip work and mean force.

        at: slip work, J, mean normal force, N, and depth, m, at the end of the step, (n_contact,) each.
        pushed (n_contact, k): derivative of the growth by what changes beside these, at constant depth.
        """
        by_work, by_force, by_depth = self.slopes(*at)
        follows, (slip_work_tangent, normal_force_tangent) = 1.0 / (1.0 - gain * by_depth), tangents
        grown: FloatArray = (follows * (gain * by_work))[:, None] * slip_work_tangent
        return grown + (follows * (gain * by_force))[:, None] * normal_force_tangent + follows[:, None] * pushed

    def _without_table(self, slip_work: FloatArray) -> FloatArray:
        return np.asarray(self.factor * np.maximum(slip_work - self.least, 0.0) * self._reduced(slip_work)[0])


ARCHARDS_WORK = WearingWork()
"""All slip work wears."""


def wearing_work(law: WearLaw, contact: ContactInterface, wear_coefficient: float) -> WearingWork:
    """The wearing work of the pairs of a joint. wear_coefficient: k_w, 1/Pa, with which the law "power" begins.

    Raises ValueError where the surfaces of the law are not those of the pairs.
    """
    surface, power, table = surface_factors(contact.surface, law.surfaces) if law.surfaces else 1.0, None, None
    friction = contact.friction if law.name in ("energy", "power") else None
    least = law.threshold * contact.area if law.name == "threshold" else 0.0
    if isinstance(law.table, PowerTerms):
        rest = law.table.adhesive / wear_coefficient if wear_coefficient > 0.0 else 1.0
        power = PowerFactors(rest, law.table.decay / contact.area)
    elif law.table is not None:
        pressure, depth, values = (np.array(part) for part in (law.table.pressure, law.table.depth, law.table.factor))
        table = PairFactors(pressure, depth, values, contact.area, np.array(law.worn) if law.worn else 0.0)
    return WearingWork(surface, least, table, power, friction)
