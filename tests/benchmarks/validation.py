"""Computed values beside what others derived, integrated in time, computed and measured, as the page shows them.

    python -m tests.benchmarks.validation [coupon] [component] [assembly] [benchmark] [--page solver/VALIDATION.md]

Cases: partial slip of a cylinder worn to the end (Ciavarella and Hills); a cylinder in gross slip, 18.5 N/mm, +-25 um
(McColl, Ding and Leen, Wear 256 (2004) 1114); Ti-6Al-4V on itself, a cylinder of 80 mm on a flat, 1066 N/mm, 8 mm long,
+-75 um of sliding, 5000 cycles at 0.05 to 5 Hz (Fouvry and others, Wear 2017), by the law of friction power, whose
three numbers are fitted to these rows, with the friction of the measured energy; the bundled dovetail by
`time_integration`, and a ring of six sectors by `ring`, whose volumes are in their files; the studies of `cases`, each
with its statement, whose targets others can meet.

As ASME V&V 20: E is the difference to the reference over the reference, u_num the estimated error over the root of
three, u_D the uncertainty of the reference; a case passes where |E| is at most twice the root of the sum of their
squares. With `--page` the table is put into the page, and its picture beside it. 11 CPU minutes.
"""

import csv
import math
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from solver import march_wear
from solver.contact.wear_law import PowerTerms, WearLaw
from solver.settings import SolverSettings
from studies import build_scene
from studies.scenes.cylinder_on_flat import line_worn_depth
from studyrunner import run_study
from studyrunner.report.drawing import line_style, style
from tests.benchmarks.error_bars import WEAR
from tests.benchmarks.frame import Table, arguments
from tests.benchmarks.ring import FRICTION as RING_FRICTION
from tests.benchmarks.ring import WEAR as RING_WEAR
from tests.rings import one_sector
from tests.solver.models import branch_states, scene
from tests.solver.models import march_wear as march_from

MCCOLL = {1000: (0.378, 0.0526), 5000: (1.131, 0.2610), 10_000: (1.815, 0.5215), 18_000: (2.713, 0.9382)}
"""Cycles: depth of the flat, um, of a finite-element code (another one has 0.2 to 1.3 % less), and its worn area, 1e-3
mm2."""
FLAT, CYLINDER = 2.9e-14, 1.9e-14  # 1/Pa

TITANIUM = {
    5.0: (0.632, 6700),
    4.0: (0.847, 7100),
    3.0: (1.18, 7760),
    2.0: (1.39, 7380),
    0.5: (2.20, 5370),
    0.11: (2.47, 6020),
    0.05: (2.55, 5660),
}
"""Frequency, Hz: measured worn volume, mm3, and dissipated energy, J."""
SLIDING, CYCLES, LOAD, LENGTH = 75e-6, 5000.0, 1.066e6, 8e-3  # m; cycles; N/m; m
ABRASIVE, ADHESIVE, DECAY = 4.6e-13, 5.5e-14, 1.1e-5  # 1/Pa, 1/Pa, m2/W
FILES = Path(__file__).parent
PICTURE = FILES.parents[1] / "studies" / "pictures" / "validation.png"
BEGIN, END = "<!-- cases -->\n", "<!-- end of cases -->\n"


@dataclass(frozen=True)
class Case:
    """One row: what is compared, with which reference; value and error of the reference and the computation.

    reference, computed: in a unit of the case. u_reference: relative standard uncertainty. error: estimated, relative.
    """

    rung: str
    name: str
    reference_is: str
    reference: float
    u_reference: float
    computed: float
    error: float

    @property
    def off(self) -> float:
        """E, relative."""
        return self.computed / self.reference - 1.0

    @property
    def u_num(self) -> float:
        """Standard uncertainty of the computation, relative."""
        return self.error / math.sqrt(3.0)

    @property
    def passes(self) -> bool:
        """Whether the difference is within twice its uncertainty."""
        return abs(self.off) <= 2.0 * math.hypot(self.u_num, self.u_reference)


def coupon() -> Iterator[Case]:
    """A cylinder on a flat: by theory, by others, and as measured."""
    mu, settings = 0.6, SolverSettings(13, 128)
    for share in (0.5, 0.75):
        radius, load, modulus = 6e-3, 1.2e5, 200e9 / (2.0 * (1.0 - 0.3**2))
        a = math.sqrt(4.0 * load * radius / (math.pi * modulus))
        x = np.linspace(0.0, 2.5 * a, 100_001)
        exact = 2.0 * float(np.trapezoid(line_worn_depth(x, radius, a, a * math.sqrt(1.0 - share)), x))
        model = build_scene("cylinder_on_flat", strips=120, Q=share * mu * load)
        worn = march_wear(model, 20.0, 1.0, mu, 1e-13, [1e7], sweep="ramp", settings=settings)
        volume, error = float(worn.worn_volume[-1]) / 0.01, float(worn.worn_volume_error[-1])
        name = f"partial slip, Q = {share:g} mu P, area in the end, um2"
        # the size of the strips is in the computation
        yield Case("coupon", name, "theory", 1e12 * exact, 0.0, 1e12 * volume, error + 0.005)
    yield from _mccoll()
    yield from _titanium()


def _mccoll() -> Iterator[Case]:
    model = build_scene("cylinder_on_flat", strips=60, P=18.5e3, stroke=25e-6, half_width=0.3e-3)
    law, settings = WearLaw(surfaces=(("flat", 1.0), ("cylinder", CYLINDER / FLAT))), SolverSettings(11, 64)
    worn = march_wear(model, 20.0, 1.0, 0.9, FLAT, list(MCCOLL), sweep="ramp", settings=settings, law=law)
    share = FLAT / (FLAT + CYLINDER)
    for place, (cycles, (depth, area)) in enumerate(MCCOLL.items(), 1):
        deepest = int(worn.wear_depth[place].argmax())
        own, error = float(worn.wear_depth[place, deepest]), float(worn.wear_depth_error[place, deepest])
        name = f"gross slip, {cycles} cycles"
        yield Case("coupon", f"{name}, depth, um", "finite elements", depth, 0.01, 1e6 * share * own, error / own)
        volume, error = float(worn.worn_volume[place]) / 0.01, float(worn.worn_volume_error[place])
        yield Case("coupon", f"{name}, area, um2", "finite elements", 1e3 * area, 0.01, 1e12 * share * volume, error)


def _titanium() -> Iterator[Case]:
    law, settings = WearLaw("power", table=PowerTerms(ADHESIVE, DECAY)), SolverSettings(5, 64)
    form = {"strips": 20, "R": 0.08, "P": LOAD, "sliding": SLIDING, "half_width": 5e-3}
    model, share = build_scene("cylinder_on_flat", E=114e9, nu=0.32, **form), LENGTH / 0.01
    for frequency, (volume, energy) in TITANIUM.items():
        friction = energy / (4.0 * SLIDING * CYCLES * LOAD * LENGTH)
        worn = march_wear(model, frequency, 1.0, friction, ABRASIVE, [CYCLES], sweep="ramp", settings=settings, law=law)
        own, error = 1e9 * share * float(worn.worn_volume[-1]), float(worn.worn_volume_error[-1])
        # the law that was fitted to these rows meets them within 8 to 15 %
        yield Case("coupon", f"Ti-6Al-4V, {frequency:g} Hz, mm3", "measured (fitted)", volume, 0.1, own, error)


def component() -> Iterator[Case]:
    """The bundled dovetail against an integration in time."""
    with (FILES / "time_integration.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    settings, cycles = SolverSettings(), np.linspace(0.0, 1e5, 101)
    for mesh, own in ((1, 0.005), (2, 0.01)):
        model = scene("dovetail_sector", 39, mesh=mesh)
        given = {float(row["Hz"]): row for row in rows if row["case"] == f"mesh {mesh}"}
        starts = branch_states(model, 0.5, 0.5, [2.0 * np.pi * frequency for frequency in given], settings)
        for (frequency, row), start in zip(given.items(), starts, strict=True):
            worn = march_from(model, 0.5, start, WEAR, 1000.0, "adaptive", cycles, settings)
            true = float(row["time integration mm3"])
            name = f"dovetail, mesh {mesh}, {frequency:g} Hz, mm3"
            volume = 1e9 * float(worn.worn_volume[-1])
            yield Case("component", name, "time integration", true, own, volume, worn.error_estimate)


def assembly() -> Iterator[Case]:
    """One sector with contact to the next one against a ring of six."""
    with (FILES / "ring.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        true = float(row["volume 1e-3 mm3 ring"])
        if true > 0.0:
            diameter, frequency = int(row["nodal diameter"]), float(row["Hz"])
            worn = march_wear(one_sector(diameter), frequency, float(row["N"]), RING_FRICTION, RING_WEAR, 300)
            name = f"ring, nodal diameter {diameter}, {frequency:g} Hz, 1e-3 mm3"
            volume, error = 1e12 * float(worn.worn_volume[-1]), float(worn.worn_volume_error[-1])
            yield Case("assembly", name, "time integration", true, 0.002, volume, error)


def read_targets() -> list[dict[str, str]]:
    """Rows of `cases/targets.csv`."""
    with (FILES / "cases" / "targets.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def run_case(row: dict[str, str], folder: Path) -> tuple[float, float]:
    """What is asked of a case, in the unit of its target, and its estimated error, relative."""
    with run_study(FILES / "cases" / f"{row['case']}.toml", folder / f"{row['case']}.nc", progress=False) as result:
        point = result.isel(cycle=-1).squeeze(drop=True)
        volume, error = float(point["worn_volume"]), float(point["worn_volume_error"])
    # of a slice of 10 mm
    return volume * (1e14 if row["unit"].endswith("m2") else 1e9), error


def benchmark() -> Iterator[Case]:
    """The studies of `cases`."""
    with tempfile.TemporaryDirectory() as folder:
        for row in read_targets():
            computed, error = run_case(row, Path(folder))
            name = f"{row['case'].replace('_', ' ')}, {row['asked']}, {row['unit']}"
            target, known = float(row["target"]), float(row["uncertainty"])
            yield Case("benchmark", name, row["reference"], target, known, computed, error)


RUNGS = (coupon, component, assembly, benchmark)


def draw(cases: list[Case]) -> None:
    """Parity: computed over reference of each case, with twice its uncertainty."""
    with style():
        figure = Figure(figsize=(8.0, 0.22 * len(cases) + 0.9), layout="constrained")
        panel = figure.subplots()
        for place, case in enumerate(cases):
            look = line_style([each.__name__ for each in RUNGS].index(case.rung))
            width = 200.0 * math.hypot(case.u_num, case.u_reference)
            fill = look["color"] if case.passes else "white"
            panel.errorbar(100.0 * case.off, place, xerr=width, fmt=look["marker"], color=look["color"], mfc=fill)
        panel.axvline(0.0, color="0.3", linewidth=1.0)
        panel.set_yticks(range(len(cases)), [case.name.rsplit(",", 1)[0] for case in cases], fontsize=7)
        panel.invert_yaxis()
        panel.margins(y=0.01)
        panel.set_xlabel("E (% of the reference); hollow: not passed")
        figure.savefig(PICTURE, dpi=130)


def main() -> None:
    rungs: dict[str, Callable[[], Iterator[Case]]] = {each.__name__: each for each in RUNGS}
    given = arguments(__doc__, list(rungs), page=None)
    table, cases, lines = (
        Table("case", "reference", "computed", "E, %", "u_num, %", "u_D, %", "passed"),
        [],
        list[str](),
    )
    for case in (each for name in given.chosen for each in rungs[name]()):
        cases.append(case)
        percent = [f"{100.0 * value:.2g}" for value in (case.off, case.u_num, case.u_reference)]
        word = "yes" if case.passes else "**no**"
        table.row(case.name, case.reference, case.computed, *percent, word)
        shown = (
            case.rung,
            case.name,
            case.reference_is,
            f"{case.reference:.4g}",
            f"{case.computed:.4g}",
            *percent,
            word,
        )
        lines.append(f"| {' | '.join(shown)} |\n")
    passed = sum(case.passes for case in cases)
    print(f"{passed} of {len(cases)} pass")
    if given.page:
        text = given.page.read_text(encoding="utf-8")
        before, _, rest = text.partition(BEGIN)
        head = (
            "| rung | case | reference | its value | computed | E, % | u_num, % | u_D, % | passed |\n|"
            + "---|" * 9
            + "\n"
        )
        whole = f"{passed} of {len(cases)} cases pass.\n\n{head}{''.join(lines)}"
        given.page.write_text(f"{before}{BEGIN}{whole}{END}{rest.partition(END)[2]}", encoding="utf-8")
        draw(cases)


if __name__ == "__main__":
    main()
