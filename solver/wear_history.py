"""The wear of one joint over the cycles: one wear history from a model in Python."""

from __future__ import annotations

import math
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from solver.contact.wear_law import ARCHARD, WearLaw, wearing_work
from solver.forced_response import check_case, check_number, check_numbers, check_word, worn_model
from solver.loading_history.start_states import follow_branch
from solver.model import ReducedModel
from solver.results.history import WearHistory
from solver.settings import (
    FOLLOWED,
    TARGETS,
    Direction,
    Followed,
    FollowedFrequency,
    Scheme,
    SolverSettings,
    ToTheEnd,
    WearTarget,
)
from solver.structure.joint import friction_of_pairs
from solver.wear.history import integrate_wear
from solver.wear.integrate import SlowTime
from solver.wear.step import steps_of


def march_wear(
    model: ReducedModel,
    frequency: float | Followed,
    excitation_amplitude: float,
    friction_coefficient: ArrayLike | None,
    wear_coefficient: float,
    cycles: ArrayLike,
    *,
    scheme: Scheme | Literal["final"] = "adaptive",
    step: float | None = None,
    sweep: Direction = "up",
    settings: SolverSettings | None = None,
    law: WearLaw = ARCHARD,
    until: WearTarget | None = None,
    outputs: int = 101,
    final_share: float = 1e-4,
    wear_depth: ArrayLike | None = None,
    between: tuple[float, float] | None = None,
) -> WearHistory:
    """Wear history of a joint that vibrates at one frequency, from its unworn state or from given depths on.

    A failure is no exception: `outcome` and `message` of the history give the reason and the last cycle count.

    Parameters
    ----------
    model
        The model, from `build_model`, `studies.build_scene` or `studies.read_scene`.
    frequency
        Frequency of the excitation, Hz; or "resonance" or "peak", which the excitation follows while the joint wears,
        see `between`.
    excitation_amplitude
        Amplitude, N. It multiplies the unit harmonic load of the model.
    friction_coefficient
        One number for all pairs, or (n_contact,) for each pair. None for a model with its own, e.g. from a scene file.
    wear_coefficient
        k_w of Eq. (2), 1/Pa; with the law "energy" the energy wear coefficient.
    cycles
        Ascending cycle counts at which the history is reported, or the last count alone. A missing 0 is added. With inf
        the history ends where wear has come to an end, see `outputs`.
    scheme, step
        "adaptive" chooses its steps by `settings.rtol`. "implicit" and "explicit" take steps of `step` cycles, Eqs.
        (23), (24). "final" is "adaptive" to the final state, in which nothing wears any more; it needs `cycles` = inf.
    sweep
        Way to the unworn state: "up" or "down" along the frequency, "ramp" with rising excitation at one frequency.
    settings
        The defaults of `SolverSettings` if not given.
    law
        The wear law, see `solver.contact.wear_law`; Archard's law if not given.
    until
        Wear at which the history ends before the last of `cycles`; `cycles_to_target` of the history is its count.
    outputs, final_share
        For `cycles` = inf. outputs: number of reported states, spaced evenly in worn volume and cycles. final_share:
        the history ends where the wear rate of each pair is below this share of its own largest wear rate.
    wear_depth
        (n_contact,), m, of a joint that is worn before: opens the pairs as a gap does. Depths and volumes of the
        history count from there.
    between
        Range of a frequency that is followed, Hz: (lowest, highest). The history begins at the first resonance that the
        sweep meets in the range. "resonance" is phase resonance: in the first harmonic, the vibration is in quadrature
        with the excitation, `F^H x` has no real part. "peak" is the largest amplitude of the first response in its
        first harmonic, over the frequency at constant wear depth. Under strong damping both differ: for one degree of
        freedom with the damping ratio zeta the peak lies lower by a factor sqrt(1 - 2 zeta^2).

    Raises
    ------
    ValueError
        A number is out of its range; counts do not ascend; the scheme needs a step that is not given; the model lacks
        nodal diameters that the harmonics need; friction coefficients are given twice, not at all, or not to each pair;
        the law is not in `wear_law.LAWS` or names surfaces that the model does not have; the law "table", whose factors
        depend on the depth, is given together with `wear_depth`.
    """
    settings = SolverSettings() if settings is None else settings
    load, friction = check_case(model, excitation_amplitude, friction_coefficient, sweep, settings)
    at, follow = _check_frequency(frequency, between, sweep, scheme)
    per_pressure = check_number("wear_coefficient", wear_coefficient, least=0.0)
    to_the_end = np.ndim(cycles) == 0 and cycles == math.inf
    counts = check_numbers("cycles", 0.0 if to_the_end else cycles, least=0.0)
    if (np.diff(counts) <= 0.0).any():
        raise ValueError("cycles: give ascending counts")
    check_word("scheme", scheme, (*get_args(Scheme), "final"))
    if scheme == "final" and (not to_the_end or until is not None):
        raise ValueError('scheme: "final" goes with cycles = inf and without until')
    if step is None and scheme not in ("adaptive", "final"):
        raise ValueError(f'step: give the length of a step in cycles to the scheme "{scheme}"')
    length = math.inf if step is None else check_number("step", step, above=0.0)
    counts = counts if counts[0] == 0.0 else np.concatenate([[0.0], counts])
    if to_the_end and scheme == "explicit":
        raise ValueError(
            'scheme: steps of the explicit scheme cannot grow: give "adaptive" or "implicit" with cycles inf'
        )
    if to_the_end and outputs < 2:
        raise ValueError(f"outputs = {outputs}: give at least 2, the unworn and the final state")
    check_number("final_share", final_share, above=0.0)
    if until is not None:
        check_word("until.quantity", until.quantity, TARGETS)
        check_number("until.value", until.value, above=0.0)
    if wear_depth is not None and law.name == "table":
        raise ValueError('wear_depth: give another law: the factors of a "table" depend on depths that count from 0')
    model = worn_model(model, wear_depth)
    # a law that does not fit the pairs is an error of the caller: raise it before the computation
    wearing_work(law, model.contact, friction_of_pairs(model, friction))
    _, start = next(follow_branch(model, friction, load, follow or np.array([at]), sweep, settings))
    read_at = ToTheEnd(outputs, final_share) if to_the_end else counts
    steps = steps_of(scheme, length, settings.rtol)
    asked = SlowTime(per_pressure, steps, read_at, law=law, until=until, follow=follow)
    return integrate_wear(model, friction, settings, start, asked)


def _check_frequency(
    frequency: float | Followed, between: tuple[float, float] | None, sweep: Direction, scheme: str
) -> tuple[float, FollowedFrequency | None]:
    """The given frequency, Hz, or NaN and what the frequency follows. Raises ValueError."""
    if not isinstance(frequency, str):
        if between is not None:
            raise ValueError('between: leave it out, or give "resonance" or "peak" as the frequency')
        return check_number("frequency", frequency, above=0.0), None
    check_word("frequency", frequency, FOLLOWED)
    if between is None:
        raise ValueError("between: give the lowest and the highest frequency in Hz, as (205, 215)")
    ends = check_numbers("between", between, above=0.0)
    if ends.size != 2 or not ends[0] < ends[1]:
        raise ValueError("between: give the lowest and the highest frequency in Hz, as (205, 215)")
    if sweep == "ramp":
        raise ValueError('sweep: give "up" or "down": a ramp holds the frequency that is sought')
    if scheme == "final":
        raise ValueError('scheme: the scheme "final" holds the frequency: give "adaptive" with cycles = inf')
    return math.nan, FollowedFrequency(frequency, float(ends[0]), float(ends[1]))
