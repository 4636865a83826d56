"""Wear of a passage of the slider through its resonance, by time integration, over the wear of its steady states.

    python -m tests.benchmarks.run_up [--rates 0.1 0.3 1 3]

Both for some sweep rates, each as |df/dt| / (zeta f)^2, up and down, with the error that the passage tells. The time
integration is that of `time_integration`: the phase of the excitation runs with the frequency, and the slip work is
summed at constant depth.
"""

import numpy as np

from solver import Block, MissionHistory, Passage, integrate_mission
from solver.model import FloatArray, ReducedModel
from studies import build_scene
from tests.benchmarks.frame import Table, arguments, measure
from tests.benchmarks.time_integration import advance, at_rest, build, settle

FRICTION, WEAR_PER_WORK = 0.5, 1e-30
ENDS, AMPLITUDE = (180.0, 220.0), 10.0  # Hz, N


def time_integrated(model: ReducedModel, passage: Passage, n_steps: int) -> FloatArray:
    """Slip work of the pairs (n_contact,), J, of a passage at constant depth, begun with the settled motion."""
    gap, middle = model.contact.gap, 0.5 * (passage.start + passage.stop)
    structure = build(model, FRICTION, passage.start, AMPLITUDE, n_steps)
    motion = settle(structure, at_rest(model, structure, gap), gap)
    # equal steps, with weights for the middle of the range
    structure = build(model, FRICTION, middle, AMPLITUDE, n_steps)
    rate = passage.rate * np.sign(passage.stop - passage.start)
    n_all = int(np.ceil(abs(passage.stop - passage.start) / passage.rate / structure.step))
    work = np.zeros(model.contact.n_contact)
    for first in range(0, n_all, 20 * n_steps):
        at = structure.step * (np.arange(first, min(first + 20 * n_steps, n_all)) + 1.0)
        phase = 2.0 * np.pi * (passage.start * at + 0.5 * rate * at**2)
        varying = np.outer(np.cos(phase), structure.cosine) + np.outer(np.sin(phase), structure.sine)
        motion = advance(structure, motion, gap, structure.static + varying)
        work += motion.work
    return work


def steady(model: ReducedModel, passage: Passage) -> MissionHistory:
    """One passage that wears next to nothing, through steady states."""
    return integrate_mission((Block(model, passage, AMPLITUDE, FRICTION, begin=passage.sweep),), WEAR_PER_WORK, 1)


def main() -> None:
    given = arguments(__doc__, rates=[0.1, 0.3, 1.0, 3.0], steps=500)
    model = build_scene("sdof_slider", damping=6.0, normal_stiffness=0.0)
    table = Table("passage, rate over (zeta f)^2", "Hz/s", "integrated over steady", "error", "CPU s")
    for start, stop in (ENDS, ENDS[::-1]):
        for rate in given.rates:
            slow = steady(model, Passage(start, stop, 1.0))
            passage = Passage(start, stop, rate / float(slow.sweep_rate[0]))
            found = measure(lambda passage=passage: steady(model, passage))
            volume = float(found.result.worn_volume[-1]) / WEAR_PER_WORK
            true = measure(lambda passage=passage: time_integrated(model, passage, given.steps).sum())
            numbers = (passage.rate, float(true.result) / volume, found.result.error_estimate)
            table.row(f"{start:g} to {stop:g} Hz, {rate:g}", *numbers, found.seconds + true.seconds)


if __name__ == "__main__":
    main()
