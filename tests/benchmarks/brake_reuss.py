"""Frequencies of a copy of the Brake-Reuss beam of Balaji's tutorial Abaqus4Joints beside those of the tutorial.

    python -m tests.benchmarks.brake_reuss --deck BRB.inp [--load SET] [--contact SURFACE SURFACE] [--units mm-t-s]

The deck is not part of this project, which has not seen it: give a copy of your own. Its C3D8R are read as C3D8I, as
their hourglass control is Abaqus' own; the beam hangs on springs of 3 Hz. Columns: all pairs glued; the pairs that the
bolts close slide without friction, the others are open. Without --deck the bundled `bolted_beam`, another beam.
"""

from pathlib import Path

import numpy as np
from scipy.linalg import eigh

import studies
from solver import SolverSettings, march_wear
from solver.model import FloatArray, ReducedModel
from studies.fe_models.from_files.model import find_files, load_model, reduce_model
from studies.fe_models.from_files.parameters import Parameters
from studies.fe_models.meshes import read_mesh_file
from tests.benchmarks.frame import Table, arguments

SUSPENSION, N_MODES = 3.0, 7
GLUED = (205.2, 238.7, 638.6, 679.8, 1263.5, 1308.1)
"""Hz, bolt and nut rigid, by CalculiX."""
SLIDING = (141.1, 152.4, 570.3, 643.5)
"""Hz, prestressed by bolts of 12 kN, without friction."""
SPRINGS = (143.7, 151.3, 575.1, 642.8, 870.6, 945.4, 1130.3)
"""Hz, the same with penalty springs."""


def sliding_frequencies(model: ReducedModel) -> tuple[FloatArray, int]:
    """Natural frequencies, Hz, where pairs that are closed at rest slide without friction; how many are closed."""
    rest = march_wear(
        model, 1.0, 0.0, 0.0, 0.0, 0.0, scheme="explicit", step=1.0, sweep="ramp", settings=SolverSettings(1)
    )
    closed = rest.mean_pressure[0] > 1e-9 * rest.mean_pressure[0].max()
    normal, linear = model.contact.dofs[:, 0], model.linear[0]
    free = np.setdiff1d(np.arange(len(linear.mass)), normal[closed & (normal >= 0)])
    values = eigh(linear.stiffness[np.ix_(free, free)], linear.mass[np.ix_(free, free)], eigvals_only=True)
    frequencies = np.sqrt(np.maximum(values, 0.0)) / (2.0 * np.pi)
    return frequencies[frequencies > 1.001 * SUSPENSION][:N_MODES], int(closed.sum())


def frequencies(deck: Path, load: str, units: str, contact: list[str]) -> tuple[FloatArray, FloatArray, str]:
    """Those with all pairs glued, those that slide, above the suspension, and what closes."""
    kinds = {block.kind for block in read_mesh_file(deck).blocks}
    parameters = Parameters(
        units=units,
        load={"set": load, "direction": (0, 0, 1)},
        suspension=SUSPENSION,
        friction_coefficient=0.0,
        stuck_modes=30,
        read_as={"C3D8R": "C3D8I"} if "C3D8R" in kinds else None,
        contact=(tuple(contact),) if contact else None,
    )
    scene = reduce_model(load_model(find_files(deck.parent, deck.name, parameters), parameters), 1)
    sliding, closed = sliding_frequencies(scene.model)
    glued = scene.glued_frequencies[0]
    return (
        glued[glued > 1.001 * SUSPENSION][:N_MODES],
        sliding,
        f"{closed} of {len(scene.model.contact.area)} pairs are closed",
    )


def main() -> None:
    given = arguments(__doc__, deck=None, load="TIP", units="mm-t-s", contact=[""])
    deck = given.deck or Path(studies.__file__).parent / "bolted_beam.inp"
    glued, sliding, closed = frequencies(deck, given.load, given.units, [name for name in given.contact if name])
    print(f"{deck.name}: {closed}")
    table = Table("mode", "glued, Hz", "tutorial", "sliding", "tutorial", "springs")
    for place in range(N_MODES):
        row = [values[place] if place < len(values) else None for values in (glued, GLUED, sliding, SLIDING, SPRINGS)]
        table.row(str(place + 1), *row)


if __name__ == "__main__":
    main()
