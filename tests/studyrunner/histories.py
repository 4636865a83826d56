"""A wear history with numbers that are easy to follow."""

import numpy as np

from solver.outcome import Outcome
from solver.results.history import WearHistory

LIKE_VOLUME = ("worn_volume", "wear_rate", "penetration", "tension", "cone_violation", "energy_error")
LIKE_DEPTH = ("wear_depth", "mean_pressure", "slip_range", "open_fraction", "response_mean", "response_peak")


def history(cycles: list[float], outcome: Outcome = Outcome.CONVERGED, loops: np.ndarray | None = None) -> WearHistory:
    """At these cycle counts: variables count from 0, or from what is theirs. loops: displacements, minus forces."""
    n = len(cycles)
    line, pair = np.arange(float(n)), np.arange(float(n)).reshape(n, 1)
    loops = np.zeros((n, 0, 128, 3)) if loops is None else loops
    of_cycles = {
        **dict.fromkeys(LIKE_VOLUME, line),
        **dict.fromkeys(LIKE_DEPTH, pair),
        "response": (1.0 + pair) * 1j,
        "excitation_frequency": 100.0 + line,
        "excitation_frequency_error": 0.1 * line,
        "residual": 1e-9 * line,
        "response_error": 1e-3 * line,
        "wear_rate_error": np.full(n, np.nan),
        "harmonics_used": np.arange(n) + 3,
        "samples_used": np.full(n, 64),
        "worn_volume_error": 0.03 * line,
        "wear_depth_error": 0.1 * pair,
        "reference_volume": 1.5 * line,
    }
    totals = {"jump_cycle": np.nan, "error_estimate": 0.0, "newton_iterations": 7, "run_time": 0.5, "branch": 2}
    totals |= {"last_cycle": float(cycles[-1]), "fold_frequency": 101.5, "step_limit": 250.0}
    at = np.array(cycles)
    return WearHistory(outcome=outcome, cycles=at, loop_displacement=loops, loop_force=-loops, **of_cycles, **totals)
