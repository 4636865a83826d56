"""Wear of a cylinder in gross slip against what others measured and computed: `python -m tests.benchmarks.validation`.

Cylinder, 18.5 N/mm, +-25 um, at the counts of McColl, Ding and Leen, Wear 256 (2004) 1114. Tests compare cylinder and
sphere in partial slip with theory.

Then Ti-6Al-4V on itself, cylinder of 80 mm on a flat, 1066 N/mm, 8 mm long, +-75 um of sliding, 5000 cycles at 0.05 to
5 Hz (Fouvry and others, Wear 2017): worn volume by the law of friction power, whose three numbers are fitted to these
rows. Friction is that of the measured energy.
"""

from solver import march_wear
from solver.contact.wear_law import PowerTerms, WearLaw
from solver.settings import SolverSettings
from studies import build_scene
from tests.benchmarks.frame import Table

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


def mccoll() -> None:
    """Depth and worn area against those of others."""
    model = build_scene("cylinder_on_flat", strips=60, P=18.5e3, stroke=25e-6, half_width=0.3e-3)
    law, settings = WearLaw(surfaces=(("flat", 1.0), ("cylinder", CYLINDER / FLAT))), SolverSettings(11, 64)
    history = march_wear(model, 20.0, 1.0, 0.9, FLAT, list(MCCOLL), sweep="ramp", settings=settings, law=law)
    share = FLAT / (FLAT + CYLINDER)
    table = Table("cycles", "depth, um", "of theirs", "area", "of theirs", "error")
    for place, (cycles, (depth, area)) in enumerate(MCCOLL.items(), 1):
        own = 1e6 * share * float(history.wear_depth[place].max())
        worn = 1e9 * share * float(history.worn_volume[place]) / 0.01
        table.row(f"{cycles}", own, own / depth, worn, worn / area, float(history.worn_volume_error[place]))


def titanium() -> None:
    """Worn volume and dissipated energy of a titanium pair over the measured ones."""
    table = Table("Hz", "worn, mm3", "of measured", "energy, J", "of measured", "error", "CPU s")
    law, settings = WearLaw("power", table=PowerTerms(ADHESIVE, DECAY)), SolverSettings(5, 64)
    form = {"strips": 20, "R": 0.08, "P": LOAD, "sliding": SLIDING, "half_width": 5e-3}
    model = build_scene("cylinder_on_flat", E=114e9, nu=0.32, **form)
    share = LENGTH / 0.01  # of the length of the scene
    for frequency, (volume, energy) in TITANIUM.items():
        friction = energy / (4.0 * SLIDING * CYCLES * LOAD * LENGTH)
        history = march_wear(
            model, frequency, 1.0, friction, ABRASIVE, [CYCLES], sweep="ramp", settings=settings, law=law
        )
        worn = 1e9 * share * float(history.worn_volume[-1])
        heat = share * float(history.dissipated_energy[-1] @ model.contact.area)
        error = float(history.worn_volume_error[-1])
        table.row(f"{frequency:g}", worn, worn / volume, heat, heat / energy, error, history.run_time)


def main() -> None:
    mccoll()
    titanium()


if __name__ == "__main__":
    main()
