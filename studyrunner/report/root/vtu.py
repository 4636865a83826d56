"""The root as files for ParaView: one VTU file a cycle count, and a PVD file that makes a time series of them.

By hand is the PVD file alone: `meshio` writes none.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from studyrunner.report.root.surface import RootSurface, known_counts, read_root
from studyrunner.result.scene_pairs import depths, of_shown_scene, tells_depth
from studyrunner.result.view import Result
from studyrunner.user_error import UserError, Verbatim

FIELDS = ("wear_depth", "mean_pressure", "slip_range", "open_fraction")
"""Variables of the contact pairs that the files hold at the nodes in contact, where the result has them."""

SERIES = "root.pvd"
"""Name of the PVD file; the VTU files are in the folder vtu beside it."""


def find_writer(result: Result) -> Callable[[Path], int]:
    """What writes the series into a folder; all that can be wrong with it is found before anything is written.

    Raises
    ------
    UserError
        Where the library is missing, or the result has nothing to draw.
    """
    if find_spec("meshio") is None:
        remedy = "install the library: pip install meshio"
        raise UserError("command line", "--vtu", Verbatim("needs meshio, which is not installed"), remedy)
    result, surface = of_shown_scene(result), None
    remedy = "leave it out: the series goes over the cycles, which nonlinear modes do not have"
    if not result.has_modes:
        remedy, surface = (
            "leave it out: the result has no mesh, or no positions of its contact pairs",
            read_root(result),
        )
    if surface is None:
        raise UserError("command line", "--vtu", Verbatim("nothing to draw"), remedy)
    return partial(write_series, result, surface)


def write_series(result: Result, surface: RootSurface, folder: Path) -> int:
    """Writes `SERIES` and `vtu/root_<number>.vtu`, one for each cycle count at which the shown point holds values.

    Points are those of the mesh before wear, m. At the points: `FIELDS` with their units in the name, as
    "wear_depth (m)", NaN where there is no contact; "worn_displacement (m)", of 3 components, from there to the worn
    surface, which ParaView's filter "Warp By Vector" exaggerates. Of the cells: `body` and `contact_surface`, numbers
    as told in a comment of the PVD file, -1 where there is no contact. The time of the series is the cycle count, of a
    final state without one the number of the output.

    Returns the number of VTU files. Raises OSError where a file cannot be written.
    """
    import meshio

    shown = result.shown_point()
    fields = {"wear_depth": depths(result, shown)} if tells_depth(result) else {}
    fields |= {name: result.at(name, shown).values for name in FIELDS if name not in fields and result.has(name)}
    units = {name: str(result.dataset[name].attrs.get("units", "1")) for name in fields if result.has(name)}
    triangle = surface.faces[:, 2] == surface.faces[:, 3]
    # a block without cells would be one of no type
    chosen = [rows for rows in (np.flatnonzero(triangle), np.flatnonzero(~triangle)) if len(rows)]
    cells = [
        ("triangle", surface.faces[rows, :3]) if triangle[rows[0]] else ("quad", surface.faces[rows]) for rows in chosen
    ]
    of_cells = {"body": surface.body, "contact_surface": surface.contact.flank}
    (folder / "vtu").mkdir(exist_ok=True)
    for old in (folder / "vtu").glob("root_*.vtu"):
        old.unlink()
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
    root.append(ElementTree.Comment(_tell(result, surface)))
    collection = ElementTree.SubElement(root, "Collection")
    numbers = known_counts(fields).tolist()
    for place, number in enumerate(numbers):
        name = f"vtu/root_{place:04d}.vtu"
        at_points = _at_points(surface, {field: values[number] for field, values in fields.items()}, units)
        at_cells = {key: [values[rows] for rows in chosen] for key, values in of_cells.items()}
        meshio.vtu.write(folder / name, meshio.Mesh(surface.nodes, cells, point_data=at_points, cell_data=at_cells))
        count = float(result.cycles[number])
        # a final state has no count
        cycle = repr(count if np.isfinite(count) else float(number))
        ElementTree.SubElement(collection, "DataSet", timestep=cycle, group="", part="0", file=name)
    ElementTree.indent(root)
    ElementTree.ElementTree(root).write(folder / SERIES, encoding="utf-8", xml_declaration=True)
    return len(numbers)


def _at_points(
    surface: RootSurface, fields: dict[str, NDArray[np.float64]], units: dict[str, str]
) -> dict[str, NDArray[np.float64]]:
    """Fields (n_nodes,) of values of pairs (n_contact,), and the way to the worn surface (n_nodes, 3)."""
    found = {}
    for name, values in fields.items():
        unit = units.get(name, "m")
        field = name if unit == "1" else f"{name} ({unit})"
        found[field] = np.full(len(surface.nodes), np.nan)
        found[field][surface.contact.nodes] = surface.contact.values(values)
    if "wear_depth" in fields:
        found["worn_displacement (m)"] = surface.worn(fields["wear_depth"], 1.0) - surface.nodes
    return found


def _tell(result: Result, surface: RootSurface) -> str:
    """What the series is, in a line of XML comment, in which two hyphens must not meet."""
    bodies = ", ".join(f"{number} {name}" for number, name in enumerate(surface.bodies))
    flanks = ", ".join(f"{number} {name}" for number, name in enumerate(surface.flanks))
    text = f"{result.title}; {result.describe(result.shown_point(), result.axes)}; time: {result.counted}"
    return f" {text}; body: {bodies}; contact_surface: {flanks} ".replace("--", "- -")
