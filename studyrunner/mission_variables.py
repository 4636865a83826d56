"""The variables of a result file of missions: slow time is counted in missions, some values belong to single blocks."""

from __future__ import annotations

from dataclasses import replace

from studyrunner.variables import ASKED, KEPT, Variable

_OF_ONE = "Of the mission that ends at the number; at 0 of the first mission."


def _by_mission(name: str) -> Variable:
    """A variable of wear histories with missions in place of cycles."""
    entry = ASKED[name]
    return replace(entry, dimensions=tuple("mission" if each == "cycle" else each for each in entry.dimensions))


OF_MISSIONS = {
    "worn_volume": replace(_by_mission("worn_volume"), comment="Of all blocks, see block_worn_volume."),
    "wear_rate": Variable(("mission",), "m3 per mission", "volume worn in a mission", comment=_OF_ONE),
    "wear_depth": _by_mission("wear_depth"),
    "wear_depth_max": _by_mission("wear_depth_max"),
    "wear_depth_max_error": _by_mission("wear_depth_max_error"),
    "wear_depth_last": ASKED["wear_depth_last"],
    "block_worn_volume": Variable(
        ("mission", "block"), "m3", "worn volume by block", comment="The blocks add up to worn_volume."
    ),
    "block_worn_volume_error": Variable(
        ("mission", "block"),
        "1",
        "estimated relative error of the worn volume by block",
        comment="0 where a block wears nothing.",
    ),
    "block_share": Variable(
        ("mission", "block"),
        "1",
        "share of a block in the volume worn in a mission",
        comment=f"{_OF_ONE} The blocks add up to 1; NaN where nothing wears.",
    ),
    "response_amplitude": Variable(
        ("mission", "block", "response"),
        "m",
        "amplitude of the first harmonic of the response at the end of a block",
        comment=_OF_ONE,
    ),
    "response_phase": Variable(
        ("mission", "block", "response"),
        "rad",
        "phase of the first harmonic of the response at the end of a block",
        comment=ASKED["response_phase"].comment,
    ),
    "response_amplitude_begin": Variable(
        ("mission", "block", "response"),
        "m",
        "amplitude of the first harmonic of the response at the begin of a block",
        comment=_OF_ONE,
    ),
    "response_peak": Variable(
        ("mission", "block", "response"),
        "m",
        "largest magnitude of the response over a period at the end of a block",
        comment=ASKED["response_peak"].comment,
    ),
    "response_peak_begin": Variable(
        ("mission", "block", "response"),
        "m",
        "largest magnitude of the response over a period at the begin of a block",
        comment=_OF_ONE,
    ),
    "response_error": Variable(
        ("mission", "block"),
        "1",
        "estimated relative error of the responses of a block",
        comment="At its begin and its end; NaN where it was not estimated.",
    ),
    "excitation_frequency": Variable(
        ("block",), "Hz", "frequency of the excitation at the end of a block", comment="Of a passage: where it stops."
    ),
    "excitation_frequency_begin": Variable(
        ("block",),
        "Hz",
        "frequency of the excitation at the begin of a block",
        comment="Of a passage: where it starts.",
    ),
    "block_cycles": Variable(("block",), "1", "vibration cycles of a block in one mission"),
    "sweep_rate": Variable(
        ("block",),
        "1",
        "sweep rate of a passage over (zeta f)^2, of the damping ratio zeta of the joint at rest",
        comment="A passage far below 1 wears as its steady states do; 0 for steady vibration and where nothing wears.",
    ),
    "worn_volume_error": replace(
        _by_mission("worn_volume_error"),
        comment="Steps over missions, blocks with their propagation, harmonics, samples and start states; 0 where"
        " nothing has worn.",
    ),
    "wear_depth_error": _by_mission("wear_depth_error"),
}
"""Those that `outputs.variables` asks for in a study of missions, in the order of the file."""

_OF_SAMPLES_ALONE = ("wear_depth_max", "wear_depth_max_error", "wear_depth_last")

OF_MISSIONS_BY_DEFAULT = tuple(name for name in OF_MISSIONS if name not in _OF_SAMPLES_ALONE)
"""Those of a study of missions that names none."""

OF_SAMPLED_MISSIONS = tuple(name for name in OF_MISSIONS if name not in ("wear_depth", "wear_depth_error"))
"""Those of a study of missions with [scatter] that names none."""

OF_A_MISSION = {
    "outcome": KEPT["outcome"],
    "missions_to_target": Variable(
        (),
        "1",
        "number of missions at which slow_time.until was reached",
        comment="The life of the joint. NaN where there is no target, or where it is never reached.",
    ),
    "missions_to_target_error": Variable(
        (), "1", "estimated error of missions_to_target", comment="Missions; NaN where the target is never reached."
    ),
    "newton_iterations": replace(
        KEPT["newton_iterations"],
        long_name="Newton iterations of the point",
        comment="Of all blocks, start states included.",
    ),
    "run_time": replace(
        KEPT["run_time"],
        long_name="CPU time of the computing thread, compiling left out",
        comment="Of all blocks; differs from run to run.",
    ),
    "error_estimate": replace(
        KEPT["error_estimate"], comment="Of the last number of missions that was reached, see worn_volume_error."
    ),
    "last_mission": Variable(
        (),
        "1",
        "number of missions up to which the point was computed",
        comment="Values after it are NaN; NaN where there is no state at all. A point that reaches slow_time.until"
        " ends, as converged, with the step that does so.",
    ),
    "largest_wear_depth": KEPT["largest_wear_depth"],
    "message": KEPT["message"],
}
"""Those that every result of missions holds."""
