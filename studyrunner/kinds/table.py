"""The table of all kinds of study."""

from collections.abc import Collection

from studyrunner.kinds.kind import Kind
from studyrunner.kinds.missions.kind import MISSIONS
from studyrunner.kinds.modes.kind import MODES
from studyrunner.kinds.wear.kind import WEAR
from studyrunner.values import Wrong

KINDS = {kind.name: kind for kind in (WEAR, MISSIONS, MODES)}
"""By name; the first is that of studies without a marker."""


def kind_of_file(name: str | None, dimensions: Collection[str]) -> Kind:
    """The kind of a result file. name: its attribute `kind`; None in files of earlier versions, whose dimensions say
    it. Raises Wrong.
    """
    if name is None:
        name = "missions" if "mission" in dimensions else "modes" if "modal_amplitude" in dimensions else "wear"
    if name not in KINDS:
        raise Wrong("the attribute kind", name, f"give a result of {', '.join(KINDS)}, or a program that knows it")
    return KINDS[name]
