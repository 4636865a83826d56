"""Wear of a cylinder in gross slip against what others measured and computed: `python -m tests.benchmarks.validation`.

Cylinder, 18.5 N/mm, +-25 um, at the counts of McColl, Ding and Leen, Wear 256 (2004) 1114. Tests compare cylinder and
sphere in partial slip with theory.
"""

from solver import march_wear
from solver.contact.wear_law import WearLaw
from solver.settings import SolverSettings
from studies import build_scene
from tests.benchmarks.frame import Table

MCCOLL = {1000: (0.378, 0.0526), 5000: (1.131, 0.2610), 10_000: (1.815, 0.5215), 18_000: (2.713, 0.9382)}
"""Cycles: depth of the flat, um, of a finite-element code (another one has 0.2 to 1.3 % less), and its worn area, 1e-3
mm2."""
FLAT, CYLINDER = 2.9e-14, 1.9e-14  # 1/Pa


def main() -> None:
    model = build_scene("cylinder_on_flat", strips=60, P=18.5e3, stroke=25e-6, half_width=0.3e-3)
    law, settings = WearLaw(surfaces=(("flat", 1.0), ("cylinder", CYLINDER / FLAT))), SolverSettings(11, 64)
    history = march_wear(model, 20.0, 1.0, 0.9, FLAT, list(MCCOLL), sweep="ramp", settings=settings, law=law)
    share = FLAT / (FLAT + CYLINDER)
    table = Table("cycles", "depth, um", "of theirs", "area", "of theirs", "error")
    for place, (cycles, (depth, area)) in enumerate(MCCOLL.items(), 1):
        own = 1e6 * share * float(history.wear_depth[place].max())
        worn = 1e9 * share * float(history.worn_volume[place]) / 0.01
        table.row(f"{cycles}", own, own / depth, worn, worn / area, float(history.worn_volume_error[place]))


if __name__ == "__main__":
    main()
