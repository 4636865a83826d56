"""The worn joint of a result computed again: its response curve and loops, without its history.

The depths of the pairs in the result are those of a joint that is mounted worn, see `[scene] worn` of a study: a study
of zero cycles gives its states.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
import xarray as xr

from studyrunner.api import run_study
from studyrunner.points.table import points_of
from studyrunner.result.pairs import depths, has_depths, pairs_of_scene
from studyrunner.result.view import NO_VOLUME, Result, open_for_report
from studyrunner.scatter import SECTOR_FREQUENCY
from studyrunner.statistics.samples import DRAWN
from studyrunner.study.scene_section import WORN_AXIS, worn_before
from studyrunner.study.sections import SOLVER_AXES
from studyrunner.study.study_file import read_study
from studyrunner.user_error import UserError

_N_FREQUENCIES = 25  # of the curve around a resonance that the study follows
_ALONE: dict[str, Any] = {
    **dict.fromkeys(("scatter", "loading", "wear", "slow_time.until", "scene.worn")),
    "axes.scheme": "adaptive",
    "slow_time": {"cycles": 0.0},
    "outputs.loops": [],
}
"""Keys of a study of unworn states of one point."""

_HOW = (
    "Mounted again after wear: computed again from the wear depths of the file, by a sweep to each frequency; its"
    " friction forces, and with them its amplitudes, are not those at the end of the wear history"
)


def has_worn_response(result: Result) -> bool:
    """Whether a result is one of wear histories, of which something is worn, over frequencies or at the resonance."""
    several = "frequency" in result.varying or "frequency_ratio" in result.varying or bool(result.followed)
    needed = result.has("worn_volume", "response_amplitude")
    return needed and several and bool(np.nanmax(result.worn, initial=0.0) > NO_VOLUME)


def compute_worn_joint(
    path: str | Path,
    folder: str | Path,
    *,
    loops: Sequence[int] = (),
    response: bool = False,
    point: Mapping[str, str] | None = None,
    progress: bool = True,
) -> dict[str, xr.Dataset]:
    """What a result does not hold of one worn joint, from the wear depths that it holds; what is asked for of:

    - "loops" of contact pairs: `loop_displacement`, m, and `loop_force`, N, (cycle, contact, phase, component), at the
      first count where the file holds its depths and at the last count;
    - "response": `response_amplitude`, m (cycle, frequency, response), and its relative error at the frequencies of the
      study; with a followed frequency over its range, and of the new joint as well.

    path: result file of wear histories. folder: for the result files of what is computed; what is there already is not
    computed twice. point: values of axes, as text; by default the point that wears most.

    Raises UserError where the file does not hold the depths, or the study has no such pairs or frequencies.
    """
    result, folder = open_for_report(path, point), Path(folder)
    with result.dataset:
        if result.kind.counted != "cycle":
            raise UserError(str(path), "kind of study", None, "give a result of wear histories")
        shown, states = result.shown, dict[str, xr.Dataset]()
        last = result.last_reached(shown)
        title = f"worn by {result.cycle_label(last)} at {result.describe(shown, ('frequency', *result.varying))}"
        keys = {**_overrides(result), "scene.worn": _depths(result, shown, last)}
        if loops:
            of_loops = {"outputs.variables": ["response_amplitude"], "outputs.loops": list(loops)}
            computed = _run(result, keys | of_loops, folder / "worn_joint_loops.nc", progress)
            states["loops"] = computed[["loop_displacement", "loop_force"]].rename(loop_contact="contact")
        if response:
            others = {name: at for name, at in shown.items() if name not in ("frequency", "frequency_ratio")}
            frequencies = result.dataset["frequency"].isel(others, missing_dims="ignore").values.tolist()
            if result.followed:
                low, high = map(float, cast("list[float]", result.study["loading"]["between"]))
                frequencies = np.linspace(low, high, _N_FREQUENCIES).tolist()
            elif len(frequencies) == 1:
                remedy = "give a result with several frequencies: this one has a single point of a curve"
                raise UserError(str(path), "axes.frequency", frequencies[0], remedy)
            if "frequency" in result.varying:
                # the curve of the new joint is in the file
                keys["scene.worn"] = _depths(result, shown, last, only_last=True)
            variables = ["response_amplitude", "response_error"]
            keys |= {"axes.frequency_ratio": None, "axes.frequency": frequencies, "outputs.variables": variables}
            computed = _run(result, keys, folder / "worn_joint_response.nc", progress)
            states["response"] = computed[variables].transpose("cycle", "frequency", ...)
    return {name: each.assign_attrs(title=title, how=_HOW) for name, each in states.items()}


def _overrides(result: Result) -> dict[str, Any]:
    """Keys of a study of the shown point alone, with the values of its sample and its scene, new and without wear.

    Raises UserError where each pair has drawn a value of its own, or the study is not that of the result.
    """
    study = read_study(result.path)
    sizes = {name: len(values) for name, values in study.dimensions.items()}
    # a file of an earlier version lacks axes of later ones: the study has their defaults, one value each
    if any(result.dataset.sizes.get(name, 1) != sizes.get(name, 1) for name in {*result.axes, *sizes}):
        raise UserError(str(result.path), "the attribute study", None, "give a result file of run-study that is whole")
    of_pairs = [name for name in study.scatter.of_pairs if name != SECTOR_FREQUENCY] if study.scatter else []
    if of_pairs:
        remedy = "give a result whose samples draw no value for each pair"
        raise UserError(str(result.path), f"scatter.{of_pairs[0]}", None, remedy)
    points, shown = points_of(study), dict.fromkeys(sizes, 0) | result.shown
    part = points.studies[points.at(points.columns["study"], shown)]
    keys: dict[str, Any] = {} if study.design is None else {"points": None}
    keys |= {f"axes.{axis.key[0]}": None for axis in study.scene_axes}
    # all of them: room for wear is made for the whole history
    parameters = part.scene.parameters.model_dump(mode="json").items()
    keys |= {f"scene.{key}": value for key, value in parameters if key not in study.evolving}
    if part.scene.ring is not None:
        drawn = f"{DRAWN}{SECTOR_FREQUENCY}"
        own = {"frequency": result.at(drawn, shown).values.tolist()} if result.has(drawn) else {}
        keys["scene.sectors"] = part.scene.ring.model_dump(mode="json") | own
        keys |= {"scene.friction_coefficient": None} if part.scene.ring.friction else {}
    for name in (*study.kind.axes, *SOLVER_AXES):
        keys[f"axes.{name}"] = points.at(points.axis(name), shown)
    if study.allowable:
        keys["axes.excitation_amplitude"] = float(result.at("allowable_amplitude", shown).values)
    if part.axes.frequency_ratio is not None:
        keys |= {"axes.frequency": None, "axes.frequency_ratio": keys["axes.frequency"]}
    if result.followed:
        if not result.has("excitation_frequency"):
            remedy = result.lacks("excitation_frequency")
            raise UserError(str(result.path), "excitation_frequency", None, remedy)
        keys["axes.frequency"] = float(result.at("excitation_frequency", shown, result.last_reached(shown)))
    evolution = result.study.get("wear", {}).get("evolution")
    return keys | _ALONE | ({"wear": {"evolution": evolution}} if evolution else {})


def _depths(result: Result, shown: Mapping[str, int], last: int, *, only_last: bool = False) -> dict[str, Any]:
    """The table `scene.worn` with the depths, and the energies of an evolving contact, at the first count, where they
    are known, and at the last one.
    """
    if not has_depths(result):
        raise UserError(str(result.path), "wear_depth", None, result.lacks("wear_depth"))
    state = shown.get(WORN_AXIS, 0)
    depth = depths(result, shown)[:, pairs_of_scene(result, shown)] + worn_before(result.study, "wear_depth", state)
    places = [last] if only_last or last == 0 or np.isnan(depth[0]).any() else [0, last]
    cycles = result.cycles[places]
    whole = {"depth": depth}
    if "evolution" in result.study.get("wear", {}):
        if not result.has("dissipated_energy"):
            raise UserError(str(result.path), "dissipated_energy", None, result.lacks("dissipated_energy"))
        energy = result.at("dissipated_energy", shown).values[:, pairs_of_scene(result, shown)]
        whole["energy"] = energy + worn_before(result.study, "dissipated_energy", state)
    if not np.isfinite(cycles).all():
        return {name: [each[last].tolist()] for name, each in whole.items()}
    return {**{name: each[places].tolist() for name, each in whole.items()}, "cycle": cycles.tolist()}


def _run(result: Result, overrides: Mapping[str, object], output: Path, progress: bool) -> xr.Dataset:
    """States (cycle, ...) of a study of zero cycles, with the wear before as `cycle` and without axes of one value."""
    study = read_study(result.path, overrides)
    output.parent.mkdir(parents=True, exist_ok=True)
    with run_study(study, output, overwrite=True, progress=progress) as dataset:
        axes = [axis for axis in dataset["outcome"].dims if axis != "worn_cycle"]
        single = [axis for axis in axes if axis != "frequency" or dataset.sizes[axis] == 1]
        states = dataset.load().isel(dict.fromkeys((*single, "cycle"), 0), drop=True)
    if "worn_cycle" not in states.dims:
        states = states.expand_dims(worn_cycle=[result.cycles[-1]])
    return states.rename(worn_cycle="cycle")
