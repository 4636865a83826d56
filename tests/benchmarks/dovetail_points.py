"""How many random points of the bundled dovetail root end with a value, adaptive scheme, and why the others do not.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.dovetail_points points.csv [--count 200] [--first 0]

Friction 0.1 to 0.8, excitation 0.1 to 3 N, 205 to 220 Hz, 2000 to 4000 rpm, mesh 1, 20 000 cycles. One line a point is
added to the file, whose points are not computed again; `--again OUTCOME ...` computes those with such an outcome again,
`--only` names points. The last line of a point counts. `--compare OTHER` prints where two files differ by more than
their error bars.
"""

import argparse
import csv
from collections import Counter
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

from solver import march_wear
from solver.clock import computing_time
from solver.outcome import Outcome
from solver.settings import SolverSettings
from studies import build_scene

SEED = 25
CYCLES = 20_000.0
WEAR = 1.1e-11  # 1/Pa
LIMIT = 200.0  # CPU seconds of a start state, and of a march
COMPLETE = {outcome.meaning for outcome in Outcome if outcome.complete}


@dataclass(frozen=True)
class Point:
    """A point and what became of it: Hz, N, rpm, mm3, relative error, cycles, CPU seconds."""

    point: int
    friction: float
    amplitude: float
    frequency: float
    speed: float
    outcome: str = ""
    volume: float = 0.0
    error: float = 0.0
    jump_cycle: float = 0.0
    last_cycle: float = 0.0
    iterations: int = 0
    seconds: float = 0.0
    message: str = ""


def random_point(number: int) -> Point:
    """Parameters of a point, by its number alone."""
    draw = np.random.default_rng([SEED, number]).uniform
    friction, amplitude, frequency, speed = draw(0.1, 0.8), draw(0.1, 3.0), draw(205.0, 220.0), draw(2000.0, 4000.0)
    return Point(number, *(float(round(value, 4)) for value in (friction, amplitude, frequency, speed)))


def computed(at: Point) -> Point:
    """The same with its result."""
    model = build_scene("dovetail_sector", mesh=1, rotation_speed=at.speed)
    started = computing_time()
    settings = SolverSettings(time_limit=LIMIT)
    history = march_wear(model, at.frequency, at.amplitude, at.friction, WEAR, CYCLES, settings=settings)
    volumes = history.worn_volume[np.isfinite(history.worn_volume)]
    return Point(
        at.point,
        at.friction,
        at.amplitude,
        at.frequency,
        at.speed,
        history.outcome.meaning,
        1e9 * float(volumes[-1]) if volumes.size else float("nan"),
        history.error_estimate,
        history.jump_cycle,
        history.last_cycle,
        history.newton_iterations,
        computing_time() - started,
        history.message,
    )


def read_points(path: Path) -> dict[int, Point]:
    """The last line of each point of a file."""
    if not path.exists():
        return {}
    kinds = {field.name: {"int": int, "str": str}.get(str(field.type), float) for field in fields(Point)}
    with path.open(newline="") as file:
        rows = [Point(**{name: kinds[name](value) for name, value in row.items()}) for row in csv.DictReader(file)]
    return {row.point: row for row in rows}


def add_point(path: Path, point: Point) -> None:
    """One more line of a file."""
    new = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Point)])
        if new:
            writer.writeheader()
        writer.writerow(
            {name: f"{value:.6g}" if isinstance(value, float) else value for name, value in asdict(point).items()}
        )


def line(point: Point) -> str:
    """A row of the table."""
    return (
        f"{point.point:4d}  mu {point.friction:.3f}  {point.amplitude:5.2f} N  {point.frequency:6.2f} Hz  "
        f"{point.speed:4.0f} rpm  {point.outcome:<18} {point.volume:9.3g} mm3 +-{100 * point.error:5.1f} %  "
        f"cycle {point.last_cycle:6.0f}  {point.iterations:6d} it  {point.seconds:6.1f} s  {point.message}"
    )


def print_table(points: dict[int, Point]) -> None:
    """Outcomes, times, and the points without a value."""
    valued = sum(point.outcome in COMPLETE for point in points.values())
    seconds = np.array([point.seconds for point in points.values()])
    print(f"{len(points)} points, {valued} with a value ({100 * valued / len(points):.1f} %)")
    print(dict(Counter(point.outcome for point in points.values())))
    print(f"CPU seconds: median {np.median(seconds):.1f}, largest {seconds.max():.0f}, all {seconds.sum():.0f}")
    for point in points.values():
        if point.outcome not in COMPLETE:
            print(line(point))


def print_differences(points: dict[int, Point], others: dict[int, Point]) -> None:
    """Points that have a value in both files, and those whose values differ by more than both error bars together."""
    both = [(point, others[number]) for number, point in points.items() if number in others]
    both = [(one, other) for one, other in both if one.outcome in COMPLETE and other.outcome in COMPLETE]
    ratios = []
    for one, other in both:
        allowed = one.error * one.volume + other.error * other.volume
        difference = abs(one.volume - other.volume)
        ratios.append(difference / allowed if allowed > 0.0 else float(difference > 0.0))
        if ratios[-1] > 1.0:
            print(line(one), line(other), sep="\n")
    largest = max(ratios, default=0.0)
    print(f"{len(both)} points with two values, largest difference {largest:.2g} of both error bars together")


def main() -> None:
    """Computes what the file does not hold yet and prints the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("file", type=Path)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", type=int, nargs="*")
    parser.add_argument("--again", nargs="*", default=[], metavar="OUTCOME")
    parser.add_argument("--compare", type=Path)
    given = parser.parse_args()
    known = read_points(given.file)
    numbers = range(given.first, given.first + given.count) if given.only is None else given.only
    for number in numbers:
        if number not in known or known[number].outcome in given.again:
            add_point(given.file, computed(random_point(number)))
            known = read_points(given.file)
            print(line(known[number]), flush=True)
    print_table(known)
    if given.compare is not None:
        print_differences(known, read_points(given.compare))


if __name__ == "__main__":
    main()
