"""The root as files for ParaView: one VTU file a cycle count, and a PVD file, by hand, that makes a series of them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from studyrunner.report.root import RootSurface, read_root
from studyrunner.result.pairs import depths, has_depths, of_shown_scene
from studyrunner.result.view import Result
from studyrunner.user_error import UserError, Verbatim

FIELDS = ("wear_depth", "mean_pressure", "slip_range", "open_fraction")
"""Variables of the contact pairs that the files hold at the nodes in contact, where the result has them."""

SERIES = "root.pvd"
"""Name of the PVD file; the VTU files are in the folder vtu beside it."""


def find_writer(result: Result) -> Callable[[Path], int]:
    """What writes the series into a folder. Raises UserError without the library, or without anything to draw."""
    if find_spec("meshio") is None:
        remedy = "install the library: pip install meshio"
        raise UserError("command line", "--vtu", Verbatim("needs meshio, which is not installed"), remedy)
    result = of_shown_scene(result)
    surface = None if result.has_modes else read_root(result)
    if surface is None:
        remedy = "leave it out: the result has no mesh, no positions of its contact pairs, or no slow time"
        raise UserError("command line", "--vtu", Verbatim("nothing to draw"), remedy)
    return partial(write_series, result, surface)


def write_series(result: Result, surface: RootSurface, folder: Path) -> int:
    """Writes `SERIES` and `vtu/root_<number>.vtu`, one for each cycle count at which the shown point holds values.

    Points are those of the mesh before wear, m. At the points: `FIELDS` with their units in the name, as
    "wear_depth (m)", NaN where there is no contact; "worn_displacement (m)", of 3 components, from there to the worn
    surface, which ParaView's filter "Warp By Vector" exaggerates. Of the faces: `body` and `contact_surface`, numbers
    in the order of the file, -1 where there is no contact. The time of the series is the cycle count.

    Returns the number of VTU files. Raises OSError where a file cannot be written.
    """
    import meshio

    shown, at_points = result.shown, dict[str, np.ndarray]()
    fields = {"wear_depth": depths(result, shown)} if has_depths(result) else {}
    fields |= {name: result.at(name, shown).values for name in FIELDS if name not in fields and result.has(name)}
    units = {name: str(result.dataset[name].attrs.get("units", "1")) if result.has(name) else "m" for name in fields}
    at_faces = {"body": [surface.body], "contact_surface": [surface.flank]}
    (folder / "vtu").mkdir(exist_ok=True)
    for old in (folder / "vtu").glob("root_*.vtu"):
        old.unlink()
    root = ElementTree.Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
    collection = ElementTree.SubElement(root, "Collection")
    known = np.flatnonzero(np.all([np.isfinite(values).all(axis=1) for values in fields.values()], axis=0))
    for place, number in enumerate(known.tolist()):
        for field, values in fields.items():
            at_nodes = np.full(len(surface.nodes), np.nan)
            at_nodes[surface.own] = values[number][surface.pairs]
            at_points[field if units[field] == "1" else f"{field} ({units[field]})"] = at_nodes
        if "wear_depth" in fields:
            at_points["worn_displacement (m)"] = surface.worn(fields["wear_depth"][number], 1.0) - surface.nodes
        # a triangle is a quadrilateral that repeats its last node
        mesh = meshio.Mesh(surface.nodes, [("quad", surface.faces)], point_data=at_points, cell_data=at_faces)
        name, count = f"vtu/root_{place:04d}.vtu", repr(float(result.cycles[number]))
        meshio.vtu.write(folder / name, mesh)
        ElementTree.SubElement(collection, "DataSet", timestep=count, group="", part="0", file=name)
    ElementTree.indent(root)
    ElementTree.ElementTree(root).write(folder / SERIES, encoding="utf-8", xml_declaration=True)
    return len(known)
