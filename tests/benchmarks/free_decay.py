"""Nonlinear modes of the dovetail root against its free decay in time.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.free_decay

The root is let go in the shape of its first glued mode and decays (`tests.benchmarks.time_integration`, nothing of
`solver/` but the model). For each amplitude: frequency and damping ratio of the decay, as means over 13 half cycles,
and those of the mode, with the amplitude lowered from twice this value, as in a decay, and raised from zero. Half a CPU
minute.
"""

import numpy as np

from solver import backbone
from studies import build_scene
from tests.benchmarks.frame import Table
from tests.benchmarks.time_integration import at_rest, build, one_period, push_mode

AMPLITUDES = (5e-4, 6e-4, 8e-4, 1e-3)  # m sqrt(kg)
LET_GO, PERIODS, STEPS = 1.3e-3, 120, 400
HALF_WINDOW = 6  # half cycles


def free_decay(structure, motion, gap, periods):
    """Displacements (n_times, n), m, from a motion on, in the steps of a structure that nothing excites."""
    seen = []
    for _ in range(periods):
        motion = one_period(structure, motion, gap)
        seen.append(motion.responses)
    return np.concatenate(seen)


def decay_of(signal, step):
    """Amplitude, frequency, Hz, and damping ratio of each cycle of a decaying signal (n_times,).

    From its peaks up and down, each by a parabola through three samples: amplitude over half a cycle to both sides.
    """
    middle = signal[1:-1]
    turns = 1 + np.flatnonzero((middle - signal[:-2]) * (signal[2:] - middle) < 0.0)
    left, here, right = signal[turns - 1], signal[turns], signal[turns + 1]
    offset = 0.5 * (left - right) / (left - 2.0 * here + right)
    times, peaks = step * (turns + offset), here - 0.25 * (left - right) * offset
    heights = 0.5 * np.abs(np.diff(peaks))
    middles = 0.5 * (times[1:] + times[:-1])
    span = middles[2:] - middles[:-2]
    rate = np.log(heights[:-2] / heights[2:])
    return heights[1:-1], 1.0 / span, rate / np.hypot(2.0 * np.pi, rate)


def main():
    model = build_scene("dovetail_sector", mesh=1)
    structure = build(model, 0.5, 212.7, 0.0, STEPS)
    begun = push_mode(structure, at_rest(model, structure, model.contact.gap), LET_GO + 0j)
    row = np.real(model.linear[0].response)[0]
    signal = free_decay(structure, begun, model.contact.gap, PERIODS) @ row
    height, frequency, damping = decay_of(signal, structure.step)
    modes = {way: backbone(model, AMPLITUDES, 0.5, sweep=way) for way in ("down", "up")}
    table = Table("m sqrt(kg), tip, mm, of", "Hz", "error", "damping, %", "error", "outcome")
    for place, amplitude in enumerate(AMPLITUDES):
        tip = np.nanmax([abs(mode.response[place, 0]) for mode in modes.values()])
        nearest = int(np.argmin(abs(height - tip)))
        window = slice(nearest - HALF_WINDOW, nearest + HALF_WINDOW + 1)
        name = f"{amplitude:.0e}, {1e3 * tip:.3f}"
        of_decay = float(frequency[window].mean()), None, 100.0 * float(damping[window].mean())
        table.row(f"{name}, decay", *of_decay, None, None)
        for way, mode in modes.items():
            damped = 100.0 * mode.damping_ratio[place], 100.0 * mode.damping_error[place]
            numbers = mode.frequency[place], mode.frequency_error[place], *damped
            table.row(f"{name}, mode {way}", *map(float, numbers), mode.outcome[place].meaning)


if __name__ == "__main__":
    main()
