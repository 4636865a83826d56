"""A followed resonance of the dovetail root against responses of the worn joint over the frequency, and cost.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.resonance

For each tenth of 1e5 cycles: frequency and amplitude of the history with their errors, and those of a sweep up of the
joint as it is worn at this count. The sweep has a friction history of its own, which the worn joint did not have: after
1e4 cycles both differ by 0.01 Hz and 1 %, later by more than any error (at a given frequency a worn joint of a history
and a sweep of the same depths differ by as much).
Then the CPU time of a followed step over that of a step at a fixed frequency, from the same start, in one process.
"""

from __future__ import annotations

import numpy as np

from solver import frequency_response, march_wear
from solver.clock import computing_time
from solver.model import ComplexArray, FloatArray, ReducedModel
from solver.settings import FOLLOWED, Followed
from studies import build_scene

BETWEEN = (205.0, 220.0)  # Hz
LOAD, FRICTION, WEAR = 0.5, 0.5, 1.1e-11  # N, 1, 1/Pa


def main() -> None:
    """Print both tables."""
    model = build_scene("dovetail_sector", mesh=1)
    print_cost(model)
    for word in FOLLOWED:
        print_brute_force(model, word)


def print_brute_force(model: ReducedModel, word: Followed) -> None:
    """Frequencies and amplitudes of a history beside those of sweeps of the worn joint."""
    history = march_wear(model, word, LOAD, FRICTION, WEAR, np.linspace(0.0, 1e5, 11), between=BETWEEN)
    print(f"{word}: {history.outcome.meaning}, {1e9 * history.worn_volume[-1]:.4g} mm3")
    for row, depth in enumerate(history.wear_depth):
        found, error = history.excitation_frequency[row], history.excitation_frequency_error[row]
        around = found + (np.linspace(-0.2, 0.2, 9) if word == "peak" else np.linspace(-0.05, 0.05, 5))
        answer = frequency_response(model, around, LOAD, FRICTION, wear_depth=depth).response[:, 0]
        place, size = (_largest if word == "peak" else _in_quadrature)(around, answer)
        print(
            f"{history.cycles[row]:8.0f} cycles  {found:.4f} +- {error:.4f} Hz, sweep {place:.4f} Hz;"
            f"  {1e3 * abs(history.response[row, 0]):.4f} mm +- {100 * history.response_error[row]:.2g} %,"
            f" sweep {1e3 * size:.4f} mm",
            flush=True,
        )


def _in_quadrature(frequency: FloatArray, response: ComplexArray) -> tuple[float, float]:
    """Frequency, Hz, and amplitude, m, where the tip moves in quadrature with the load, which acts there."""
    real = np.polynomial.Polynomial.fit(frequency, response.real, 2)
    roots = real.roots()
    place = float(roots[np.argmin(abs(roots - frequency.mean()))].real)
    return place, float(abs(np.polynomial.Polynomial.fit(frequency, response.imag, 2)(place)))


def _largest(frequency: FloatArray, response: ComplexArray) -> tuple[float, float]:
    """Frequency, Hz, and size, m, of the largest amplitude.

    An amplitude that is known to 1e-3 places the flat top within 0.02 Hz only.
    """
    curve = np.polynomial.Polynomial.fit(frequency, abs(response), 4)
    fine = np.linspace(frequency[0], frequency[-1], 2001)
    place = float(fine[np.argmax(curve(fine))])
    return place, float(curve(place))


def print_cost(model: ReducedModel) -> None:
    """CPU time of 40 followed steps over that of 40 steps at the first frequency."""
    first = march_wear(model, "resonance", LOAD, FRICTION, 0.0, 0.0, between=BETWEEN)
    given: tuple[float | Followed, ...] = (float(first.excitation_frequency[0]), *FOLLOWED)
    seconds = []
    for frequency in given:
        between = BETWEEN if isinstance(frequency, str) else None
        starting, whole = (_seconds(model, frequency, between, cycles) for cycles in (0.0, 1e4))
        seconds.append(whole - starting)
        ratio = seconds[-1] / seconds[0]
        print(f"{frequency}: start {starting:.2f} s, 40 steps {seconds[-1]:.2f} s, {ratio:.2f} of given", flush=True)


def _seconds(
    model: ReducedModel, frequency: float | Followed, between: tuple[float, float] | None, cycles: float
) -> float:
    """CPU time of a history, s."""
    began = computing_time()
    march_wear(model, frequency, LOAD, FRICTION, WEAR, cycles, scheme="implicit", step=250.0, between=between)
    return computing_time() - began


if __name__ == "__main__":
    main()
