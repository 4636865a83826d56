"""The variables of a result file of missions: slow time is counted in missions, some values belong to single blocks."""

from __future__ import annotations

from dataclasses import replace

from studyrunner.variables import ASKED, KEPT, Variable

_OF_ONE = "Of the mission that ends at the number; at 0 of the first mission."
_BLOCK, _BLOCKS, _RESPONSES = ("block",), ("mission", "block"), ("mission", "block", "response")


def _by_mission(name: str) -> Variable:
    """A variable of wear histories with missions in place of cycles."""
    entry = ASKED[name]
    return replace(entry, dimensions=tuple("mission" if each == "cycle" else each for each in entry.dimensions))


def _of_block(name: str, when: str = "end") -> Variable:
    """A variable of wear histories at the end, or at the beginning, of a block."""
    entry, long_name = ASKED[name], f"{ASKED[name].long_name} at the {when} of a block"
    if entry.units == "Hz":
        return Variable(_BLOCK, "Hz", long_name)
    return replace(entry, dimensions=_RESPONSES, long_name=long_name, comment=_OF_ONE)


OF_MISSIONS = {
    "worn_volume": replace(_by_mission("worn_volume"), comment="Of all blocks, see block_worn_volume."),
    "wear_rate": Variable(("mission",), "m3 per mission", "volume worn in a mission", comment=_OF_ONE),
    "wear_depth": _by_mission("wear_depth"),
    "wear_depth_max": _by_mission("wear_depth_max"),
    "wear_depth_max_error": _by_mission("wear_depth_max_error"),
    "wear_depth_last": ASKED["wear_depth_last"],
    "block_worn_volume": Variable(_BLOCKS, "m3", "worn volume by block", comment="The blocks add up to worn_volume."),
    "block_worn_volume_error": Variable(
        _BLOCKS, "1", "estimated relative error of the worn volume by block", comment="0 where a block wears nothing."
    ),
    "block_share": Variable(
        _BLOCKS, "1", "share of a block in the volume worn in a mission", comment=f"{_OF_ONE} NaN where nothing wears."
    ),
    "response_amplitude": _of_block("response_amplitude"),
    "response_phase": _of_block("response_phase"),
    "response_amplitude_begin": _of_block("response_amplitude", "beginning"),
    "response_peak": _of_block("response_peak"),
    "response_peak_begin": _of_block("response_peak", "beginning"),
    "response_error": Variable(_BLOCKS, "1", "estimated relative error of the responses of a block"),
    "excitation_frequency": _of_block("excitation_frequency"),
    "excitation_frequency_begin": _of_block("excitation_frequency", "beginning"),
    "block_cycles": Variable(_BLOCK, "1", "vibration cycles of a block in one mission"),
    "sweep_rate": Variable(
        _BLOCK,
        "1",
        "sweep rate of a passage over (zeta f)^2, of the damping ratio zeta of the joint at rest",
        comment="A passage far below 1 wears as its steady states do; 0 for steady vibration and where nothing wears.",
    ),
    "worn_volume_error": _by_mission("worn_volume_error"),
    "wear_depth_error": _by_mission("wear_depth_error"),
}
"""Those that `outputs.variables` asks for in a study of missions, in the order of the file."""

_OF_SAMPLES_ALONE = ("wear_depth_max", "wear_depth_max_error", "wear_depth_last")

OF_MISSIONS_BY_DEFAULT = tuple(name for name in OF_MISSIONS if name not in _OF_SAMPLES_ALONE)
"""Those of a study of missions that names none."""

OF_SAMPLED_MISSIONS = tuple(name for name in OF_MISSIONS if name not in ("wear_depth", "wear_depth_error"))
"""Those of a study of missions with [scatter] that names none."""


def _kept_by_mission(name: str) -> Variable:
    entry = KEPT[name]
    long_name, comment = (
        text.replace("cycle count", "number of missions").replace("cycles", "missions")
        for text in (entry.long_name, entry.comment)
    )
    return replace(entry, long_name=long_name, comment=comment)


OF_A_MISSION = {
    "outcome": KEPT["outcome"],
    "missions_to_target": _kept_by_mission("cycles_to_target"),
    "missions_to_target_error": _kept_by_mission("cycles_to_target_error"),
    "newton_iterations": replace(KEPT["newton_iterations"], comment="Of all blocks."),
    "run_time": replace(KEPT["run_time"], comment="Of all blocks; differs from run to run."),
    "error_estimate": KEPT["error_estimate"],
    "last_mission": _kept_by_mission("last_cycle"),
    "largest_wear_depth": KEPT["largest_wear_depth"],
    "message": KEPT["message"],
}
"""Those that every result of missions holds."""
