"""The frame of the benchmarks: their arguments, what a computation takes, and a table printed row by row."""

import argparse
import csv
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from solver.clock import computing_time
from solver.newton import run as newton


@dataclass(frozen=True)
class Measured:
    """Result of a computation, its CPU seconds without compiling, and iterations of Newton's method."""

    result: Any
    seconds: float
    iterations: int


def measure(compute: Callable[[], Any]) -> Measured:
    """Computes, and counts the iterations that are really made."""
    iterations, own = 0, newton.solve_newton

    def counted(*given: Any, **named: Any) -> Any:
        nonlocal iterations
        found = own(*given, **named)
        iterations += found[1]
        return found

    began = computing_time()
    newton.solve_newton = counted
    try:
        result = compute()
    finally:
        newton.solve_newton = own
    return Measured(result, computing_time() - began, iterations)


def dense_solve(n: int, repeats: int = 7) -> float:
    """CPU seconds of one `numpy.linalg.solve` of n unknowns, the unit of run times; the median of some."""
    matrix, right, spent = np.random.default_rng(0).standard_normal((n, n)), np.ones(n), []
    for _ in range(repeats):
        began = time.thread_time()
        np.linalg.solve(matrix, right)
        spent.append(time.thread_time() - began)
    return float(np.median(spent))


class Table:
    """A table of columns, the first one of words; also as comma-separated values where a file is given."""

    def __init__(self, *columns: str, file: Path | None = None) -> None:
        self.widths = [42, *(max(len(column), 9) for column in columns[1:])]
        self.columns, self.rows, self.file = columns, list[tuple[object, ...]](), file
        if file is not None:
            file.write_text("", encoding="utf-8")
        self.row(*columns)

    def row(self, *values: object) -> None:
        """Prints a row: numbers with five digits, nothing for None."""
        self.rows.append(values)
        words = [
            "" if value is None else f"{value:.5g}" if isinstance(value, float) else str(value) for value in values
        ]
        print(f"{words[0]:<{self.widths[0]}}", *(f"{w:>{n}}" for w, n in zip(words[1:], self.widths[1:], strict=True)),
              sep="  ", flush=True)  # fmt: skip
        if self.file is not None:
            with self.file.open("a", encoding="utf-8", newline="") as file:
                csv.writer(file).writerow(words)

    @property
    def frame(self) -> pd.DataFrame:
        """The rows, with the columns by name."""
        return pd.DataFrame(self.rows[1:], columns=self.columns)


def arguments(doc: str | None, choices: Sequence[str] = (), **defaults: Any) -> argparse.Namespace:
    """The options of the command line, by their defaults; a list takes several values, None a path.

    choices: words that may be named, as `chosen`; all of them by default.
    """
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    if choices:
        # without `choices`, which refuse an empty list
        parser.add_argument("chosen", nargs="*", help=f"of {', '.join(choices)}; all by default")
    for name, default in defaults.items():
        several = isinstance(default, list)
        kind = Path if default is None else type(default[0] if several else default)
        parser.add_argument(f"--{name.replace('_', '-')}", type=kind, default=default, nargs="*" if several else None)
    given = parser.parse_args()
    if choices:
        given.chosen = given.chosen or list(choices)
        if wrong := set(given.chosen).difference(choices):
            parser.error(f"{', '.join(wrong)}: use {', '.join(choices)}")
    return given
