"""What nonlinear modes ask of the tables of a study."""

from collections.abc import Iterator

from studyrunner.study.study import Study
from studyrunner.values import Wrong


def broken_rules(study: Study) -> Iterator[Wrong]:
    """The amplitude goes up or down; each worn joint has a cycle count."""
    if "ramp" in study.axes.sweep:
        yield Wrong("axes.sweep", "ramp", 'give "up" or "down": the modal amplitude is raised or lowered')
    if study.scene.worn is not None and not any(axis.key == ("worn",) for axis in study.scene_axes):
        remedy = "missing: give the cycle count of each depth, the coordinate of the modes"
        yield Wrong("scene.worn.cycle", None, remedy)
