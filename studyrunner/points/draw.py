"""What the samples of a study draw of its inputs, and the study of each sample."""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from solver.model import ContactInterface
from studies.sectors import LARGEST_DEVIATION
from studyrunner.scatter import SECTOR_FREQUENCY, Scattered, draw
from studyrunner.study.room import with_room_for_wear
from studyrunner.study.scene_section import SceneSection
from studyrunner.study.study import Study
from studyrunner.user_error import UserError
from studyrunner.values import Wrong


def draw_inputs(
    study: Study,
    pairs: ContactInterface | None = None,
    own_values: Mapping[str, NDArray[np.float64]] | None = None,
    n_sectors: int = 1,
) -> dict[str, NDArray[np.float64]]:
    """Values of the inputs that are the same for all pairs, or with pairs of those that belong to them, as `draw`.

    study: without axes that are keys of [scene] or [wear]. own_values: of the pairs, (n_pairs,), or sectors. Raises
    UserError.
    """
    section = study.scatter
    if section is None:
        return {}
    inputs = section.inputs.items()
    own: Mapping[str, ArrayLike] = own_values or {
        name: _own_value(study, name, each) for name, each in inputs if name not in section.of_pairs
    }
    try:
        found = draw(section, own, pairs, n_sectors)
        largest = float(np.abs(found.get(SECTOR_FREQUENCY, 0.0)).max())
        if largest > LARGEST_DEVIATION:
            remedy = f"give less width: a sample draws a deviation of {largest:.3g}, at most {LARGEST_DEVIATION} is one"
            raise Wrong(f"scatter.{SECTOR_FREQUENCY}", None, remedy)
        return found
    except Wrong as error:
        raise UserError(study.source, error.key or "scatter", error.value, error.remedy) from None


def _own_value(study: Study, name: str, scattered: Scattered) -> ArrayLike:
    """The study's own value of an input; 1, for any, of an absolute distribution."""
    study = study.part_of(name)
    if name in study.kind.numbers:
        return np.array(getattr(study.axes, name))[:, None]
    value = {**dict(study.scene.parameters), **study.wear.numbers}.get(name)
    if isinstance(value, float | int):
        return float(value)
    if not scattered.distribution.is_absolute:
        remedy = "give the middle of the distribution as well: the study has no value of its own"
        raise UserError(study.source, f"scatter.{name}", None, remedy)
    return 1.0


def samples_of(study: Study) -> Iterator[Study]:
    """The study with what each sample draws.

    Values that differ between contact pairs are not in them. Raises UserError where a sample draws one that is none.
    """
    assert study.scatter is not None
    values = draw_inputs(study)
    of_wear = [name for name in values if name in study.wear.numbers]
    of_scene = [name for name in values if name not in (*study.kind.numbers, *of_wear)]
    blocks = [samples_of(block) for block in study.block_studies]
    for sample in range(study.scatter.n_rows):
        of_axes = {name: tuple(values[name][:, sample].tolist()) for name in values if name in study.kind.numbers}
        update: dict[str, object] = {"scatter": None, "axes": study.axes.model_copy(update=of_axes)}
        if of_scene:
            update["scene"] = _with_drawn(study, {name: float(values[name][sample]) for name in of_scene})
        if of_wear:
            update["wear"] = study.wear.with_numbers({name: float(values[name][sample]) for name in of_wear})
        update["block_studies"] = tuple(next(block) for block in blocks)
        part = study.model_copy(update=update)
        # a scene of its own has room for what this sample wears, blocks have equal pairs
        yield with_room_for_wear(part) if blocks or of_scene else part


def _with_drawn(study: Study, values: Mapping[str, float]) -> SceneSection:
    """The scene with drawn values of its parameters. Raises UserError where one of them is wrong."""
    parameters = study.scene.parameters
    try:
        # all that is asked of a friction coefficient was checked when it was drawn
        if values.keys() == {"friction_coefficient"}:
            parameters = parameters.model_copy(update=dict(values))
        else:
            parameters = type(parameters).model_validate({**dict(parameters), **values})
    except ValueError as error:
        name = next((each for each in values if each in str(error)), next(iter(values)))
        remedy = "give less width: a sample draws a value that the scene cannot have"
        raise UserError(study.source, f"scatter.{name}", values[name], remedy) from None
    return study.scene.model_copy(update={"parameters": parameters})
