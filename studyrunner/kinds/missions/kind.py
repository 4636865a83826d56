"""Missions: their variables, and what they read of a study.

Slow time is counted in missions, and some values are those of single blocks.
"""

from dataclasses import replace

from studyrunner.kinds.kind import Kind
from studyrunner.kinds.wear.kind import ASKED, OF_A_HISTORY, OF_RINGS, OF_SAMPLES_ALONE
from studyrunner.variables import Variable

_OF_ONE = "Of the mission that ends at the number; at 0 of the first mission."
_BLOCK, _BLOCKS = ("block",), ("mission", "block")


def _by_mission(name: str) -> Variable:
    """A variable of wear histories with missions in place of cycles."""
    entry = (ASKED | OF_A_HISTORY | OF_RINGS)[name]
    long_name, comment = (
        text.replace("cycle count", "number of missions").replace("cycles", "missions")
        for text in (entry.long_name, entry.comment)
    )
    dimensions = tuple("mission" if each == "cycle" else each for each in entry.dimensions)
    return replace(entry, dimensions=dimensions, long_name=long_name, comment=comment)


def _of_block(name: str, when: str = "end") -> Variable:
    """A variable of wear histories at the end, or at the beginning, of a block."""
    entry, long_name = ASKED[name], f"{ASKED[name].long_name} at the {when} of a block"
    if entry.units == "Hz":
        return Variable(_BLOCK, "Hz", long_name)
    return replace(entry, dimensions=(*_BLOCKS, "response"), long_name=long_name, comment=_OF_ONE)


OF_MISSIONS = {
    "worn_volume": replace(_by_mission("worn_volume"), comment="Of all blocks, see block_worn_volume."),
    "wear_rate": Variable(("mission",), "m3 per mission", "volume worn in a mission", _OF_ONE),
    "wear_depth": _by_mission("wear_depth"),
    "wear_depth_max": _by_mission("wear_depth_max"),
    "wear_depth_max_error": _by_mission("wear_depth_max_error"),
    "wear_depth_last": ASKED["wear_depth_last"],
    "block_worn_volume": Variable(_BLOCKS, "m3", "worn volume by block", "The blocks add up to worn_volume."),
    "block_worn_volume_error": Variable(
        _BLOCKS, "1", "estimated relative error by block", "0 where a block wears nothing."
    ),
    "block_share": Variable(_BLOCKS, "1", "share of a block in the wear of a mission", f"{_OF_ONE} NaN: no wear."),
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
        "A passage far below 1 wears as its steady states do; 0 for steady vibration and where nothing wears.",
    ),
    "worn_volume_error": _by_mission("worn_volume_error"),
    "wear_depth_error": _by_mission("wear_depth_error"),
    "dissipated_energy": _by_mission("dissipated_energy"),
    "dissipated_energy_error": _by_mission("dissipated_energy_error"),
}

OF_A_MISSION = {
    "outcome": OF_A_HISTORY["outcome"],
    "missions_to_target": _by_mission("cycles_to_target"),
    "missions_to_target_error": _by_mission("cycles_to_target_error"),
    "newton_iterations": replace(OF_A_HISTORY["newton_iterations"], comment="Of all blocks."),
    "run_time": replace(OF_A_HISTORY["run_time"], comment="Of all blocks; differs from run to run."),
    "error_estimate": OF_A_HISTORY["error_estimate"],
    "last_mission": _by_mission("last_cycle"),
    "largest_wear_depth": OF_A_HISTORY["largest_wear_depth"],
    "message": OF_A_HISTORY["message"],
}

MISSIONS = Kind(
    name="missions",
    words="missions",
    about="Fretting wear of a joint over missions: scene {scene}. Worn volume by block, wear depths, vibration, and the"
    " errors of each.",
    time="to a factor of three, if every block wears",
    marker="[[mission]]",
    axes=("frequency", "wear_coefficient", "excitation_amplitude", "sweep"),
    numbers=("frequency", "wear_coefficient", "excitation_amplitude"),
    reads={"slow_time": ("missions", "outputs", "until"), "outputs": ("variables", "scene")},
    why="leave it out: slow_time.missions counts in place of cycles, and missions choose their own steps",
    asked=OF_MISSIONS,
    always=OF_A_MISSION,
    of_rings={name: _by_mission(name) for name in ("sector_worn_volume", "sector_wear_depth")}
    | {
        name: replace(
            entry, dimensions=(*_BLOCKS, *entry.dimensions[1:]), long_name=f"{entry.long_name}, at the end of a block"
        )
        for name, entry in OF_RINGS.items()
        if "wear" not in name and "worn" not in name
    },
    usual=tuple(name for name in OF_MISSIONS if name not in OF_SAMPLES_ALONE),
    of_samples=tuple(name for name in OF_MISSIONS if name not in ("wear_depth", "wear_depth_error")),
    counted="mission",
    whole=True,
    dimensions=lambda study: {"block": [block.name for block in study.mission]},
)
