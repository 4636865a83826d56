"""A wear history with numbers that are easy to follow."""

import numpy as np

from solver.outcome import Outcome
from solver.results.history import WearHistory


def history(cycles: list[float], outcome: Outcome = Outcome.CONVERGED, loops: np.ndarray | None = None) -> WearHistory:
    """At these cycle counts: variables count from 0, or from what is theirs. loops: displacements, minus forces."""
    n = len(cycles)
    line, pair = np.arange(float(n)), np.arange(float(n)).reshape(n, 1)
    return WearHistory(
        outcome=outcome,
        cycles=np.array(cycles),
        worn_volume=line,
        wear_rate=line,
        wear_depth=pair,
        mean_pressure=pair,
        slip_range=pair,
        open_fraction=pair,
        response=(1.0 + pair) * 1j,
        response_peak=pair,
        excitation_frequency=100.0 + line,
        excitation_frequency_error=0.1 * line,
        loop_displacement=np.zeros((n, 0, 128, 3)) if loops is None else loops,
        loop_force=np.zeros((n, 0, 128, 3)) if loops is None else -loops,
        jump_cycle=np.nan,
        error_estimate=0.0,
        newton_iterations=7,
        run_time=0.5,
        residual=1e-9 * line,
        penetration=line,
        tension=line,
        cone_violation=line,
        energy_error=line,
        response_error=1e-3 * line,
        wear_rate_error=np.full(n, np.nan),
        harmonics_used=np.arange(n) + 3,
        samples_used=np.full(n, 64),
        stable=np.arange(n) < 2,
        worn_volume_error=0.03 * line,
        wear_depth_error=0.1 * pair,
        reference_volume=1.5 * line,
        last_cycle=float(cycles[-1]),
        branch=2,
        fold_frequency=101.5,
        step_limit=250.0,
        oscillates=True,
    )
