"""A whole response curve of a joint, over frequency or excitation amplitude: folds, unstable parts, multipliers."""

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from solver.accuracy.refinement import refine
from solver.accuracy.resolved_state import ResolvedState
from solver.arguments import check_case, check_number, check_numbers, worn_model
from solver.continuation.arc_length import Arc
from solver.continuation.natural import SMOOTH_CHANGE
from solver.forced_response import HarmonicBalance, balance_at_start, functions_of
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import State, first_response, largest_responses
from solver.loading_history.path import LoadingPath
from solver.model import BoolArray, ComplexArray, FloatArray, IntArray, ReducedModel
from solver.newton.run import Run
from solver.outcome import Outcome, check
from solver.presentation import NOT_IN_DATASETS, Presented, unit_of
from solver.settings import SMALL, Direction, SolverSettings
from solver.stability.floquet import Multipliers, Stability, find_multipliers

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FEWEST_STEPS = 50  # of a curve without folds: enough for a drawing

_Branch = tuple[list[State], list[int], Outcome, str]
"""States in the order of the curve, indices of the folds among them, and how the curve ends, in words."""


@dataclass(frozen=True, repr=False)
class ResponseCurve(Presented):
    """Periodic states along a curve, `n_points` of them in the order of the curve, unstable ones included.

    - parameter: "frequency" or "excitation_amplitude", which changes along the curve; the other one is constant.
    - frequency, excitation_amplitude (n_points,): Hz, N.
    - response, response_peak (n_points, n_response): as in `FrequencyResponse`.
    - response_error (n_points,): estimated relative error by harmonics and samples; inf where unknown, as beside
      folds; NaN where not asked for.
    - is_fold (n_points,): points at which the parameter turns.
    - stability: of each point "stable"; "fold", "period doubling" or "Neimark-Sacker" by the disturbance that grows;
      "unknown" where no multipliers are computed, see `solver.stability.floquet`.
    - multipliers: Floquet multipliers of each point, largest modulus first; the largest ones only of a large joint;
      none where unknown. Those of a small joint with impacts belong to a state with at least 19 harmonics.
    - multiplier_error (n_points,): estimated error of the first multiplier by time steps; inf where unknown.
    - outcome, message: CONVERGED where the curve comes to the last value; BRANCH_LOST where not, and how far.
    """

    OVER = ("point", "point")
    SHOWN = ("frequency", "excitation_amplitude", "response")

    parameter: Literal["frequency", "excitation_amplitude"]
    frequency: FloatArray
    excitation_amplitude: FloatArray
    response: ComplexArray
    response_peak: FloatArray
    response_error: FloatArray
    is_fold: BoolArray
    stability: tuple[Stability, ...]
    multipliers: tuple[ComplexArray, ...] = field(metadata=NOT_IN_DATASETS)
    multiplier_error: FloatArray
    outcome: Outcome
    message: str
    _balances: tuple[HarmonicBalance, ...] = field(repr=False, compare=False, metadata=NOT_IN_DATASETS)

    @property
    def point(self) -> IntArray:
        """Numbers of the points (n_points,)."""
        return np.arange(self.frequency.size)

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """As for other results, over the parameter that changes along the curve; solid where it is stable."""
        from matplotlib import pyplot

        axes = axes or pyplot.subplots()[1]
        at, stable = getattr(self, self.parameter), np.array(self.stability) == "stable"
        for size in np.abs(self.response).T:
            (line,) = axes.plot(at, size, ":")
            axes.plot(at, np.where(stable, size, np.nan), color=line.get_color())
        label = f"{self.parameter.replace('_', ' ')} in {unit_of(self.parameter)}"
        axes.set(xlabel=label, ylabel="response in m", title="solid where stable")
        return axes

    def balance(self, index: int) -> HarmonicBalance:
        """Residual, Jacobian, Fourier coefficients and time signals of a point."""
        return self._balances[index]


def response_curve(
    model: ReducedModel,
    frequency: ArrayLike,
    excitation_amplitude: ArrayLike,
    friction_coefficient: ArrayLike | None,
    *,
    settings: SolverSettings | None = None,
    wear_depth: ArrayLike | None = None,
    most_points: int = 1000,
    errors: bool = True,
) -> ResponseCurve:
    """The curve of periodic states from one frequency, or one excitation amplitude, to another, through all folds.

    The first state is that of `frequency_response`, swept "up" to the lower or "down" to the upper frequency; for a
    curve over the amplitude a "ramp". From there arc length follows the curve, with the harmonics, samples and
    tangential history of the first state: a slow sweep of a machine, which leaves a history of its own at each
    frequency, and which jumps at folds, is `frequency_response`. A curve may turn back behind its first value before it
    comes to the last one, by as much as both are apart.

    frequency, excitation_amplitude: one number for one of them, Hz or N, and first and last value of the other one.
    settings: best with given harmonics, as the first state may need fewer than others.
    most_points: largest number of points. errors: False leaves out `response_error`, which takes most of the time.
    All others, and ValueError, as in `frequency_response`.
    """
    omegas = 2.0 * np.pi * check_numbers("frequency", frequency, above=0.0)
    loads = check_numbers("excitation_amplitude", excitation_amplitude, least=0.0)
    over_frequency = omegas.size == 2
    both, one_and_two = "frequency, excitation_amplitude", sorted((omegas.size, loads.size)) == [1, 2]
    check(both, one_and_two, "give one number for one of them, two for the other one")
    first, last = (omegas if over_frequency else loads).tolist()
    check(both, first != last, "give two different numbers as first and last value")
    most = int(check_number("most_points", most_points, least=2.0))
    sweep: Direction = ("up" if first < last else "down") if over_frequency else "ramp"
    model, load, settings = check_case(model, loads[0], friction_coefficient, sweep, settings)
    worn, omega = worn_model(model, wear_depth), float(omegas[0])
    start, case, balance, found = balance_at_start(worn, load, omega / (2.0 * np.pi), sweep, settings)
    path = LoadingPath(case, load) if over_frequency else LoadingPath(case, 1.0, omega)
    if found is None:
        branch: _Branch = [], [], start.outcome, start.message
    else:
        # a branch may turn back behind its start before it comes to the last value
        back = max(2.0 * first - last, SMALL * first) if first > 0.0 else -np.inf
        span = abs(last - first) / (SMOOTH_CHANGE * _FEWEST_STEPS)
        begun, run = replace(found, next_history=balance.history, parameter=float(first)), Run(settings.tolerance)
        arc = Arc(lambda parameter: Balance(path.joint_at(parameter), balance.history), path.slope, begun, span, run)
        branch = _follow_branch(arc, last, back, most, over_frequency)
    return _reported(path, branch, errors)


def _follow_branch(arc: Arc, last: float, back: float, most: int, over_frequency: bool) -> _Branch:
    """Follow a branch until its parameter passes `last`, or the limit `back` on the other side of the start.

    most: largest number of points.
    """
    points, folds = [arc.start], list[int]()
    said = "the curve was followed up to {}: more harmonics or samples may help"
    for before, reached, fold in arc.steps(float(np.sign(last - arc.start.parameter))):
        if fold is not None:
            if fold is not points[-1] and fold is not reached:
                points.append(fold)
            folds.append(len(points) - (fold is not reached))
        passed = [at for at in (last, back) if (reached.parameter - at) * (before.parameter - at) <= 0.0]
        if passed:
            end = arc.state_at(before, reached, passed[0])
            points.extend([] if end is None else [end])
            if passed[0] == back:
                said = "the curve turns back as far as {}: begin farther away"
            elif end is not None:
                return points, folds, Outcome.CONVERGED, ""
            break
        points.append(reached)
        if len(points) >= most:
            said = f"the curve has most_points = {most} points up to {{}}: give more"
            break
    at = points[-1].parameter
    end_at = f"{at / (2.0 * np.pi):.6g} Hz" if over_frequency else f"{at:.6g} N"
    return points, folds, Outcome.BRANCH_LOST, said.format(end_at)


def _reported(path: LoadingPath, branch: _Branch, errors: bool) -> ResponseCurve:
    """The curve of a branch, each point with its error and multipliers."""
    (points, folds, outcome, message), case = branch, path.case
    n_points = len(points)
    response = np.empty((n_points, len(case.model.response_names)), np.complex128)
    peak, error = np.empty(response.shape), np.full(n_points, np.nan)
    found: list[Multipliers] = []
    stability: list[Stability] = []
    balances: list[HarmonicBalance] = []
    for index, point in enumerate(points):
        balance, at = Balance(path.joint_at(point.parameter), point.next_history), point.evaluation
        joint, run = balance.joint, Run(case.settings.tolerance)
        response[index], peak[index] = first_response(joint, at), largest_responses(joint, at)
        if errors:
            error[index] = refine(ResolvedState(case, point), run).estimate.response
        found.append(find_multipliers(case, point, run))
        stability.append(found[-1].stability(odd=not run.fresh().is_stable(joint, at)))
        balances.append(functions_of(balance, at.predicted_h, Outcome.CONVERGED, ""))
    return ResponseCurve(
        parameter="frequency" if path.omega is None else "excitation_amplitude",
        frequency=np.array([each.frequency for each in balances]),
        excitation_amplitude=np.array([each.excitation_amplitude for each in balances]),
        response=response,
        response_peak=peak,
        response_error=error,
        is_fold=np.isin(np.arange(n_points), folds),
        stability=tuple(stability),
        multipliers=tuple(each.values for each in found),
        multiplier_error=np.array([each.error for each in found]),
        outcome=outcome,
        message=message,
        _balances=tuple(balances),
    )
