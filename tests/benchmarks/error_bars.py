"""Estimated over true errors of worn volumes of the bundled dovetail: all schemes and steps, and random loads.

    python -m tests.benchmarks.error_bars --mesh 1 2
    python -m tests.benchmarks.error_bars --mesh 1 --diameter 3 7 --frequency -0.25 0.25
    python -m tests.benchmarks.error_bars --mesh --loads 60 [--rtol 1e-1 1e-2] [--truth 0] [--records FILE.csv]
    python -m tests.benchmarks.error_bars --mesh --records FILE.csv --picture FILE.png

The truth of a dovetail is the adaptive scheme with a tolerance of 1e-3, of a travelling wave 3e-3. That of a random
load has a third of the smallest `--rtol`, at least 1e-4, and automatic harmonics: with 13 and 256 samples the truth of
load 46 is 4 % off. Of histories with 1e-4 it tells the start state alone. With `--truth 0` there is none, as it takes
minutes: a difference is 0 and the error at most the estimated one. Random loads are adaptive histories of mesh 1 near
its resonance, 5e4 to 6e5 cycles; `--loads 20 40` are those from 20 to 39. A file of records, which a new run replaces,
has each row as soon as it is computed, and the last command shows what it has by then. Wanted: at least half the true
error everywhere, in the median not more than ten times it. Differences below the error of the truth, or below `FLOOR`
of the volume, do not count: the truth is not known better.

Columns: relative errors of the worn volume at the end: estimated, difference to the truth, of the truth; ratio of the
first two; the smallest ratio of volumes and of responses on the way; that of the depths of all pairs that have a tenth
of the deepest; how many of these depths are outside of their errors. CPU time and iterations are those of a point of a
study, with its start state. Frequencies of a travelling wave (`--diameter`) are offsets from the resonance of the glued
structure, Hz.

At 212.5 Hz two pairs of mesh 2 come to rest at 15 000 cycles, or go on by a hair, by the harmonics of the sweep: 0.071
mm3 with 9 to 27 given harmonics and 256 samples or more, 0.094 with nodes of 5 harmonics.
"""

from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.markers import CARETDOWN
from matplotlib.ticker import PercentFormatter

from solver.model import FloatArray, ReducedModel
from solver.outcome import Outcome
from solver.results.history import WearHistory
from solver.settings import Scheme, SolverSettings
from studyrunner.report.drawing import WIDTH, add_legend, line_style, set_log, style
from studyrunner.units import show_percent
from tests.benchmarks.frame import Table, arguments
from tests.solver.models import branch_states, glued_frequency, march_wear, scene

WEAR = 1.1e-11  # 1/Pa
STEPS = [250.0, 500.0, 1000.0, 2000.0]
FREQUENCIES = {1: (212.5, 212.75, 213.0, 213.25), 2: (211.0, 211.25, 211.375, 211.5, 211.75, 212.0, 212.25, 212.5)}
OFFSETS = (-0.25, 0.25)  # Hz, from the resonance of the glued structure, of travelling waves
HARMONICS = 39  # whose nodal diameters the scene holds
FLOOR = 2e-3
RATIOS = ("on the way", "responses", "depths")
COLUMNS = (
    *("rtol", "estimated", "difference", "of the truth", "ratio", *RATIOS),
    *("outside", "of", "CPU s", "iterations", "outcome"),
)
COMPLETE = [outcome.meaning for outcome in Outcome if outcome.complete]


def smallest_ratio(estimated: FloatArray, true: FloatArray, seen: np.ndarray) -> float:
    """Smallest ratio of estimated and true errors where they are seen, inf where none are; all (n,)."""
    return float((estimated[seen] / true[seen]).min(initial=np.inf))


def compare(history: WearHistory, truth: WearHistory, rtol: float) -> list[object]:
    """The columns of the table for a history, asked for with this rtol, against the true one at the same counts."""
    true = np.abs(history.worn_volume - truth.worn_volume)
    # only where something has worn and the truth is known, and there better than the difference
    worn = (truth.worn_volume > 1e-3 * np.nan_to_num(truth.worn_volume).max()) & np.isfinite(true)
    known = worn & (true > np.maximum(FLOOR, truth.worn_volume_error) * truth.worn_volume)
    moved = np.linalg.norm(history.response - truth.response, axis=1) / np.linalg.norm(truth.response, axis=1)
    depth = truth.wear_depth[-1]
    deep = (depth > 0.1 * depth.max()) & np.isfinite(history.wear_depth[-1])
    off, off_estimated = np.abs(history.wear_depth[-1] - depth)[deep], history.wear_depth_error[-1][deep]
    off = np.where(off > np.maximum(FLOOR * depth, truth.wear_depth_error[-1])[deep], off, 0.0)
    last = 0.0 if true[-1] == 0.0 else float(true[-1] / history.worn_volume[-1])
    return [
        *(rtol, history.error_estimate, last, truth.error_estimate),
        history.error_estimate / last if known[-1] else float("nan"),
        smallest_ratio(history.worn_volume_error * history.worn_volume, true, known),
        smallest_ratio(history.response_error, moved, worn & (moved > np.maximum(FLOOR, truth.response_error))),
        smallest_ratio(off_estimated, off, off > 0.0),
        *(int((off > off_estimated).sum()), int(deep.sum())),
        *(history.run_time, history.newton_iterations, history.outcome.meaning),
    ]


def are_kept(rows: pd.DataFrame) -> pd.Series:
    """Which histories are computed to the end and known within their rtol."""
    return (rows["estimated"] <= rows["rtol"]) & rows["outcome"].isin(COMPLETE)


def summarise(rows: pd.DataFrame) -> None:
    """For each rtol: how many adaptive histories keep it, their CPU time and differences; median and worst ratios; how
    many are too small.
    """
    for rtol, of_rtol in rows.groupby("rtol"):
        adaptive = of_rtol[~of_rtol.iloc[:, 0].astype(str).str.contains("implicit|explicit")]
        kept, known, ratio = are_kept(adaptive), of_rtol[np.isfinite(of_rtol["difference"])], of_rtol["ratio"].dropna()
        spent, off = adaptive["CPU s"], adaptive["difference"]
        print(f"rtol {rtol:g}: {len(of_rtol)} histories, {kept.sum()} of {kept.size} adaptive ones within it")
        print(f"CPU s: median {spent.median():.1f}, of those within rtol {spent[kept].median():.1f}")
        print(f"difference of {off.count()} adaptive ones: median {off.median():.2g}, largest {off.max():.2g}")
        print(f"ratio at the end, {ratio.size} known: median {ratio.median():.2f}, least {ratio.min():.2f}")
        for name in RATIOS:
            print(f"{name}: least {known[name].min():.2f}, {(known[name] < 0.5).sum()} below 0.5")
        print(f"{known['outside'].sum()} of {known['of'].sum()} depths outside")


def draw(rows: pd.DataFrame, picture: Path) -> None:
    """Error against CPU time of each history; for each rtol the share of histories that keep it, and the CPU time."""
    rows = rows.assign(kept=are_kept(rows), error=np.maximum(rows["difference"], rows["of the truth"]))
    known, handles = rows[np.isfinite(rows["error"]) & (rows["error"] > 0.0)], []
    names = [show_percent(rtol) for rtol in sorted(rows["rtol"].unique(), reverse=True)]
    with style():
        figure = Figure(figsize=(WIDTH, 3.8), layout="constrained")
        panels = figure.subplot_mosaic([["error", "share"], ["error", "time"]], width_ratios=(1.7, 1.0))
        for place, (rtol, all_of) in enumerate(sorted(rows.groupby("rtol"), reverse=True)):
            colour, marker = line_style(place)["color"], line_style(place)["marker"]
            handles.append(Line2D([], [], color=colour, marker=marker, linestyle="--", label=f"rtol {names[place]}"))
            panels["error"].axhline(rtol, linestyle="--", linewidth=1.0, color=colour)
            for _, row in known[known["rtol"] == rtol].iterrows():
                at, error, fill = row["CPU s"], row["error"], colour if row["kept"] else "white"
                panels["error"].plot(at, error, color=colour, marker=marker, markerfacecolor=fill)
                if row["difference"] < error:
                    panels["error"].plot((at, at), (error, 0.7 * error), marker=CARETDOWN, markevery=[1], color=colour,
                                         linewidth=0.8, zorder=1.5)  # fmt: skip
            share, (low, median, high) = all_of["kept"].mean(), all_of["CPU s"].quantile([0.25, 0.5, 0.75])
            panels["share"].bar(place, share, 0.6, color=colour)
            panels["share"].text(place, share, f"{all_of['kept'].sum()}/{len(all_of)}", ha="center", va="bottom")
            panels["time"].vlines(place, low, high, color=colour)
            panels["time"].plot(place, median, color=colour, marker=marker)
        set_log(panels["error"].xaxis, known["CPU s"].min(), known["CPU s"].max())
        set_log(panels["error"].yaxis, known["error"].min(), rows["rtol"].max(), percent=True)
        set_log(panels["time"].yaxis, rows["CPU s"].min(), rows["CPU s"].max())
        for name in ("share", "time"):
            panels[name].set(xlim=(-0.5, len(names) - 0.5))
            panels[name].set_xticks(range(len(names)), names)
        title = f"{len(known)} of {len(rows)} histories: those whose error is known"
        panels["error"].set(xlabel="CPU time of a point (s)", ylabel="error of final worn volume", title=title)
        panels["share"].set(ylabel="share within rtol", ylim=(0.0, 1.2), yticks=(0.0, 0.5, 1.0))
        panels["share"].yaxis.set_major_formatter(PercentFormatter(1.0, symbol=" %"))
        panels["time"].set(xlabel="rtol", ylabel="CPU time (s)", title="median and quartiles")
        for fill, marker, meaning in (
            *(("0.3", "o", "estimated within rtol"), ("white", "o", "inaccurate")),
            ("0.3", CARETDOWN, "at most: the truth is not known better"),
        ):
            look = {"marker": marker, "markerfacecolor": fill, "linestyle": "none"}
            handles.append(Line2D([], [], color="0.3", label=meaning, **look))
        add_legend(figure, handles)
        figure.savefig(picture, dpi=160)


def dovetail(title: str, model: ReducedModel, steps: list[float], frequencies: FloatArray) -> None:
    """All schemes and steps at some frequencies, Hz."""
    cycles, table, omegas = np.linspace(0.0, 1e5, 101), Table(title, *COLUMNS), list(2.0 * np.pi * frequencies)
    runs: list[tuple[Scheme, float]] = [("adaptive", 1e-2)]
    runs += [(scheme, step) for scheme in ("implicit", "explicit") for step in steps]
    exact, settings = SolverSettings(rtol=3e-3 if model.nodal_diameter else 1e-3), SolverSettings()
    starts = branch_states(model, 0.5, 0.5, omegas, settings)
    for frequency, fine, start in zip(frequencies, branch_states(model, 0.5, 0.5, omegas, exact), starts, strict=True):
        truth = march_wear(model, 0.5, fine, WEAR, 1000.0, "adaptive", cycles, exact)
        for scheme, step in runs:
            history = march_wear(model, 0.5, start, WEAR, step, scheme, cycles, settings)
            table.row(f"{frequency:.7g} Hz, {scheme} {step:g}", *compare(history, truth, settings.rtol))
    summarise(table.frame)


def random_loads(seeds: range, rtols: list[float], records: Path | None, *, with_truth: bool) -> None:
    """Adaptive histories of the coarse dovetail near its resonance under random loads; those that wear."""
    table, model = Table("seed", *COLUMNS, file=records), scene("dovetail_sector", HARMONICS, mesh=1)
    first, exact = glued_frequency(model), SolverSettings(rtol=max(1e-4, 0.3 * min(rtols)))
    for seed in seeds:
        random = np.random.default_rng(1000 + seed)
        frequency = first * random.uniform(0.9955, 1.0008)
        load, friction = float(np.exp(random.uniform(*np.log([0.4, 1.3])))), random.uniform(0.3, 0.6)
        wear = float(np.exp(random.uniform(*np.log([2e-12, 5e-11]))))
        asked = wear, 1000.0, "adaptive", np.linspace(0.0, 10.0 ** random.uniform(4.7, 5.8), 41)
        way = model, friction, load, [2.0 * np.pi * frequency]
        sweep = str(random.choice(["up", "down", "ramp"]))
        print(f"{seed}: {frequency:.7g} Hz, {load:.3g} N, {sweep}", flush=True)
        truth = march_wear(model, friction, *branch_states(*way, exact, sweep), *asked, exact) if with_truth else None
        for settings in (SolverSettings(rtol=rtol) for rtol in rtols):
            history = march_wear(model, friction, *branch_states(*way, settings, sweep), *asked, settings)
            other = truth or history
            # one that is not known may wear
            if (other.worn_volume == 0.0).all():
                break
            table.row(str(seed), *compare(history, other, settings.rtol))
    summarise(table.frame)


def main() -> None:
    lists = {"mesh": [1], "diameter": [0], "loads": [0], "rtol": [1e-2], "step": STEPS, "frequency": [0.0]}
    given = arguments(__doc__, **lists, records=None, picture=None, truth=1)
    for mesh, diameter in product(given.mesh, given.diameter):
        model = scene("dovetail_sector", HARMONICS, mesh=mesh, nodal_diameter=diameter)
        frequencies = np.array(given.frequency if any(given.frequency) else OFFSETS if diameter else FREQUENCIES[mesh])
        first = glued_frequency(model) if diameter else 0.0
        dovetail(f"mesh {mesh}, d {diameter}", model, given.step, first + frequencies)
    if any(given.loads):
        random_loads(range(*given.loads), given.rtol, given.records, with_truth=bool(given.truth))
    if given.picture:
        rows = pd.read_csv(given.records)
        draw(rows, given.picture)
        if not any(given.loads):
            summarise(rows)


if __name__ == "__main__":
    main()
