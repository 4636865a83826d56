"""What a mesh of the bundled dovetail root is worth.

    python -m tests.benchmarks.meshes --mesh 1 2 3 [--records meshes.csv]

Worn volumes after 1e5 cycles at equal f/f_1, with f_1 the first frequency of the glued sector of each mesh: so the
frequency of the finite elements does not count.
"""

import numpy as np

from solver.settings import SolverSettings
from tests.benchmarks.frame import Table, arguments, measure
from tests.solver.models import branch_states, glued_frequency, march_wear, scene

FRICTION, AMPLITUDE, WEAR = 0.5, 0.5, 1.1e-11  # 1, N, 1/Pa
HARMONICS = 21
SHARES = [0.99556, 0.99676, 0.99735, 0.99794, 0.99853, 0.99912, 1.00029]  # f/f_1


def main() -> None:
    given = arguments(__doc__, mesh=[1, 2, 3], share=SHARES, records=None)
    columns = ("f/f_1", "worn volume, mm3", "error", "outcome", "tip, mm", "worn tip, mm", "CPU s")
    table, settings = Table("model", *columns, file=given.records), SolverSettings()
    for mesh in given.mesh:
        model = scene("dovetail_sector", HARMONICS, mesh=mesh)
        first = glued_frequency(model)
        omegas = [2.0 * np.pi * share * first for share in given.share]
        starts = branch_states(model, FRICTION, AMPLITUDE, omegas, settings)
        for share, start in zip(given.share, starts, strict=True):
            asked = (1e3, "adaptive", np.linspace(0.0, 1e5, 11), settings)
            found = measure(lambda: march_wear(model, FRICTION, start, WEAR, *asked))  # noqa: B023
            history, tip = found.result, 1e3 * abs(found.result.response[[0, -1], 0])
            worn = (1e9 * float(history.worn_volume[-1]), history.error_estimate, history.outcome)
            table.row(f"mesh {mesh}, {first:.2f} Hz", share, *worn, *tip.tolist(), start.run_time + found.seconds)


if __name__ == "__main__":
    main()
