"""The final state by an active set where the joint is cooperative, by a march to the end where it is not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from solver.accuracy.harmonic_levels import fewer
from solver.clock import computing_time
from solver.contact.wear_law import ARCHARD, WearLaw
from solver.model import FloatArray, ReducedModel
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import OutOfTimeError, move_point
from solver.outcome import SENSITIVE_ERROR, Outcome, describe_error, known_to
from solver.packing import Packed
from solver.results.cut_off import judge_cut_off
from solver.results.history import StartState, WearHistory
from solver.results.recorder import Recorder
from solver.settings import RESOLUTION, SolverSettings, ToTheEnd
from solver.structure.joint import build_case
from solver.wear.final_state.active_set import NoActiveSetError, wear_off
from solver.wear.final_state.cooperation import failure
from solver.wear.march import march_wear
from solver.wear.options import WEAR
from solver.wear.trajectory import Trajectory


def find_final_state(
    model: ReducedModel,
    friction_coefficient: float | FloatArray | None,
    start: StartState,
    wear_coefficient: float,
    end: ToTheEnd,
    settings: SolverSettings,
    loops: tuple[int, ...] = (),
    keep: Callable[[Packed], None] | None = None,
    resume: Packed | None = None,
    law: WearLaw = ARCHARD,
) -> WearHistory:
    """The state at which nothing wears any more; arguments as of `march_wear`.

    Returns
    -------
    WearHistory
        `final_method` says how it was found. "active_set": the first output is the unworn state, the last the final
        one, whose count is inf; those in between are NaN. "march": that of the adaptive scheme, and its message says
        why and what the active set has instead.
    """
    direct: WearHistory | None = None
    reason, spent = "", 0.0
    if start.state is not None:
        began = computing_time()
        try:
            direct, reason = _directly(model, friction_coefficient, start, wear_coefficient, end, settings, loops, law)
        except NoActiveSetError as error:
            reason = str(error)
        except OutOfTimeError:
            reason = "it was not found in solver.time_limit"
        except Exception as error:
            # the march is there all the same
            reason = describe_error(error)
        spent = computing_time() - began
    if direct is not None and not reason:
        return direct
    marched = march_wear(
        model,
        friction_coefficient,
        start,
        wear_coefficient,
        np.inf,
        "adaptive",
        end,
        settings,
        loops=loops,
        keep=keep,
        resume=resume,
        law=law,
    )
    remark = f"no active set: {reason}" if reason else ""
    if direct is not None and direct.worn_volume[-1] > 0.0 and np.isfinite(marched.worn_volume[-1]):
        volumes = 1e9 * direct.worn_volume[-1], 1e9 * marched.worn_volume[-1]
        apart = float(np.abs(direct.wear_depth[-1] - marched.wear_depth[-1]).max())
        remark += f"; it has {volumes[0]:.4g} mm3, the march {volumes[1]:.4g} mm3, depths differ by {apart:.2g} m"
    message = "; ".join(filter(None, (marched.message, remark)))
    return replace(marched, final_method="march", run_time=marched.run_time + spent, message=message)


def _directly(
    model: ReducedModel,
    friction_coefficient: float | FloatArray | None,
    start: StartState,
    wear_coefficient: float,
    end: ToTheEnd,
    settings: SolverSettings,
    loops: tuple[int, ...],
    law: WearLaw,
) -> tuple[WearHistory, str]:
    """The history by the active set, and why it is not to be taken. Raises NoActiveSetError where there is none."""
    began, share = computing_time(), end.final_share
    case = build_case(model, friction_coefficient, start.penalty_omega, settings, start.resolution)
    trajectory = Trajectory(case, start, wear_coefficient, "implicit", loops, law)
    trajectory.effort.deadline = began + settings.time_limit
    outcome = trajectory.begin()
    if outcome is not Outcome.CONVERGED:
        raise NoActiveSetError(f"{outcome.meaning} at the unworn state")
    counts = np.full(end.n_outputs, np.nan)
    counts[0], counts[-1] = 0.0, 1.0
    recorder = Recorder(model, counts, start.newton_iterations, start.run_time, "implicit", len(loops))
    recorder.add(0.0, trajectory.report(), wear_coefficient)
    unworn = trajectory.point
    # the wear rate of the final state is round-off: its error counts for what it is beside that of the unworn one
    trajectory.usual_work = float(unworn.evaluation.slip_work.sum())
    none = np.zeros(model.contact.n_contact, bool)
    off = wear_off(trajectory, unworn.evaluation.wear_depth, none, share)
    reason = failure(trajectory, unworn, off, share)
    for _ in range(WEAR.off_attempts):
        resolution = trajectory.case.resolution
        outcome = trajectory.check()
        if outcome is not Outcome.CONVERGED or trajectory.case.resolution == resolution:
            break
        # other harmonics move the pairs otherwise, and they graze at other depths
        off = wear_off(trajectory, unworn.evaluation.wear_depth, off.off, share)
    if outcome is Outcome.CONVERGED:
        outcome = trajectory.stability()
    if outcome is not Outcome.CONVERGED:
        reason = reason or f"its final state is {outcome.meaning}"
    recorder.add(1.0, trajectory.report(), wear_coefficient, 0.0)
    depth = trajectory.point.evaluation.wear_depth
    # no depth is known better than the states are solved
    error = np.abs(_coarser(trajectory, start, share) - depth) + settings.tolerance * depth
    history = recorder.finish(
        outcome,
        np.nan,
        trajectory.effort.iterations,
        computing_time() - began,
        np.zeros_like(recorder.kept["wear_depth"]),
    )
    return _finished(history, trajectory, start, error), reason


def _coarser(trajectory: Trajectory, start: StartState, share: float) -> FloatArray:
    """Final depths (n_contact,), m, from the state of the coarser sweep with fewer harmonics; NaN if not found."""
    resolution = fewer(trajectory.case.resolution, SolverSettings())
    if resolution.highest < RESOLUTION.first_harmonics:
        resolution = trajectory.case.resolution
    coarse = replace(start, state=start.coarse or start.state)
    first = Trajectory(
        trajectory.case.at(start.resolution), coarse, trajectory.wear_coefficient, "implicit", (), trajectory.wear_law
    )
    first.effort = trajectory.effort
    nothing = np.full(trajectory.slip_work_error.size, np.nan)
    first.step_limit = trajectory.step_limit
    first.take_start()
    case = first.case.at(resolution)
    joint = case.joint(first.joint.omega, first.joint.excitation_amplitude)
    moved = move_point(first.case, case, joint, first.point, first.effort)
    if moved is None:
        return nothing
    first.case, first.joint, first.point, first.solver = case, joint, moved, JacobianSolver()
    unworn = moved.evaluation.wear_depth
    first.accept(moved, 0.0)
    try:
        return wear_off(first, unworn, np.zeros(unworn.size, bool), share).point.evaluation.wear_depth
    except NoActiveSetError:
        return nothing


def _finished(history: WearHistory, trajectory: Trajectory, start: StartState, error: FloatArray) -> WearHistory:
    """The history with its count and errors. error (n_contact,): m, of the final depths."""
    volume, area = float(history.worn_volume[-1]), trajectory.joint.contact.area
    relative = float(error @ area) / volume if volume > 0.0 else 0.0
    errors, depths = history.worn_volume_error.copy(), history.wear_depth_error.copy()
    errors[0], errors[-1] = 0.0, relative
    depths[0], depths[-1] = 0.0, error
    cycles = history.cycles.copy()
    # the recorder has the final state at count 1
    cut_off = history.cut_off_cycle if history.cut_off_cycle != cycles[-1] else np.inf
    cycles[-1] = np.inf
    outcome, message = history.outcome, ""
    if outcome is Outcome.CONVERGED and relative > SENSITIVE_ERROR:
        outcome, message = Outcome.SENSITIVE, "the worn volume is another one with fewer harmonics and a coarser sweep"
    elif outcome is Outcome.CONVERGED and not trajectory.accurate:
        outcome = Outcome.INACCURATE
        rtol = trajectory.case.settings.rtol
        message = f"the response in the final state {known_to(trajectory.estimate.response, rtol)}"
    ended = replace(
        history,
        outcome=outcome,
        message=message,
        cycles=cycles,
        last_cycle=float("inf"),
        worn_volume_error=errors,
        wear_depth_error=depths,
        error_estimate=relative,
        branch=start.branch,
        fold_frequency=start.fold_frequency,
        step_limit=trajectory.step_limit if trajectory.step_limit > 0.0 else float("inf"),
        final_method="active_set",
        cut_off_cycle=cut_off,
    )
    return judge_cut_off(ended)
