"""The mesh of a scene in three dimensions: outer faces of bodies, contact pairs on them, views of both, and VTU files.

A result file holds outer faces and positions of pairs, but not which face belongs to which pair: faces all of whose
corners are nodes at which pairs stand are in contact. Where the meshes of two bodies do not match, those are the faces
of one of them.

By hand: `mplot3d` leaves a wide margin, and draws both sides of a face alike; the PVD file is a few lines.
"""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from studyrunner.result.pairs import contact_pairs, depths, has_depths, of_shown_scene
from studyrunner.result.view import Result
from studyrunner.user_error import UserError, Verbatim

MESH = ("mesh_x", "mesh_y", "mesh_z", "mesh_quad")

FIELDS = ("wear_depth", "mean_pressure", "slip_range", "open_fraction", "dissipated_energy")
"""Variables of the contact pairs that the files hold at the nodes in contact, where the result has them."""

SERIES = "root.pvd"
"""Name of the PVD file; the VTU files are in the folder vtu beside it."""

Floats = NDArray[np.float64]
Places = NDArray[np.int64]

_DEEPEST = 0.04  # worn depth as it is drawn, over the size of the contact surfaces
_CORNERS, _MOST_CLOSE_UPS = 4, 7
_SAME = 1e-6  # distance of a node and its pair, over the size of the mesh

_AROUND = 0.16  # of a close-up: how much is seen around the contact surfaces, over their size
_BEFORE = 0.06  # what stands before a contact surface is cut off from here on, over the same size
_WHOLE = np.array([0.35, -0.6, -0.72])  # to the eye, where upwards is x
_ASLANT, _FROM_ABOVE = 0.55, 0.3
# colours of the bodies in their order: their lightness differs, in print as well
_BODIES, _NAMED = ("#d9b38c", "#9ecae1", "#c7c7c7", "#b5d99c"), {"blade": "#9ecae1", "disk": "#d9b38c"}
_INSIDE, _EDGES, _EDGEWAYS = 0.42, 0.25, 1e-9


@dataclass(frozen=True)
class RootSurface:
    """Outer faces of the bodies of a joint, and what its contact pairs are on them.

    nodes (n_nodes, 3): m. faces (n_faces, 4): nodes anticlockwise from outside; triangles repeat their last one.
    body (n_faces,): index into `bodies`, whose faces hang together by their nodes. flank (n_faces,): index into
    `flanks`, the labels of the contact surfaces, -1 for faces not in contact. contact_nodes (n,): nodes of the faces in
    contact, ascending; pairs (n,): the contact pair at each, normals (n, 3): unit vectors out of the body.
    """

    nodes: Floats
    faces: Places
    body: Places
    bodies: tuple[str, ...]
    flank: Places
    flanks: tuple[str, ...]
    contact_nodes: Places
    pairs: Places
    normals: Floats

    def worn(self, depth: Floats, factor: float) -> Floats:
        """Nodes (n_nodes, 3), m, with the wear depth (n_contact,), m, times a factor taken off both surfaces."""
        worn = self.nodes.copy()
        worn[self.contact_nodes] -= factor * np.nan_to_num(depth[self.pairs])[:, None] * self.normals
        return worn

    def near_contact(self, most_faces: int) -> "RootSurface":
        """The surface with at most so many faces: those in contact, and those nearest to them."""
        if len(self.faces) <= most_faces:
            return self
        distance, _ = cKDTree(self.nodes[self.contact_nodes]).query(self.nodes[self.faces].mean(axis=1))
        order = np.argsort(np.where(self.flank >= 0, -1.0, distance), kind="stable")
        kept = np.sort(order[: max(most_faces, int((self.flank >= 0).sum()))])
        used, places = np.unique(self.faces[kept], return_inverse=True)
        faces, touching = places.reshape(-1, _CORNERS), np.searchsorted(used, self.contact_nodes)
        of_faces: dict[str, Any] = {"faces": faces, "body": self.body[kept], "flank": self.flank[kept]}
        return replace(self, nodes=self.nodes[used], contact_nodes=touching, **of_faces)

    @property
    def well_seen(self) -> float:
        """Depth, m, that is well seen beside the size of the contact surfaces."""
        return _DEEPEST * float(np.linalg.norm(np.ptp(self.nodes[self.contact_nodes], axis=0)))

    def exaggeration(self, deepest: float) -> float:
        """Factor 1, 2 or 5 times a power of ten with which a depth, m, is well seen; 1 where nothing is worn."""
        if not deepest > 0.0 or not math.isfinite(deepest) or not self.well_seen > 0.0:
            return 1.0
        return _round_below(self.well_seen / deepest)


def _round_below(value: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is not above a value, which is above 0."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(factor * power for factor in (1.0, 2.0, 5.0) if factor == 1.0 or factor * power <= value * (1.0 + 1e-9))


def read_root(result: Result) -> RootSurface | None:
    """The faces of a file; None where it has no mesh, no positions of pairs, or no pairs on its mesh."""
    pairs = contact_pairs(result, result.shown)
    if not np.isfinite(pairs.position).all() or not result.has(*MESH):
        return None
    nodes, faces, parts = read_mesh(result)
    if not len(faces) or faces.shape[1] != _CORNERS:
        return None
    flanks = tuple(dict.fromkeys(pairs.surface.tolist()))
    flank = np.array([flanks.index(label) for label in pairs.surface.tolist()])
    # bodies are counted in the order of their faces
    rows, columns = faces[:, [0, 0, 0]].ravel(), faces[:, 1:].ravel()
    joined = sparse.coo_matrix((np.ones(rows.size), (rows, columns)), shape=(len(nodes), len(nodes)))
    _, component = connected_components(joined, directed=False)
    _, first, body = np.unique(component[faces[:, 0]], return_index=True, return_inverse=True)
    body = np.argsort(np.argsort(first))[body].astype(np.int64)
    flank, touching, at, normals = _find_contact_faces(nodes, faces, pairs.position, flank)
    # the part most of its faces belong to; with a number where bodies share it
    found = [Counter(parts[body == number].tolist()).most_common(1)[0][0] for number in range(int(body.max()) + 1)]
    names = tuple(
        name if name and found.count(name) == 1 else f"{name or 'body'} {found[: place + 1].count(name)}"
        for place, name in enumerate(found)
    )
    return RootSurface(nodes, faces, body, names, flank, flanks, touching, at, normals) if touching.size else None


def read_mesh(result: Result) -> tuple[Floats, Places, NDArray[np.str_]]:
    """Nodes (n, 3), m, faces (n_faces, 4) and their parts (n_faces,), "" where the file names none."""
    nodes = np.stack([result.dataset[f"mesh_{axis}"].values for axis in "xyz"], axis=1).astype(float)
    faces = result.dataset["mesh_quad"].values.astype(np.int64)
    parts = result.dataset["mesh_part"].values.astype(np.str_) if result.has("mesh_part") else np.full(len(faces), "")
    return nodes, faces, parts


def face_normals(corners: Floats) -> Floats:
    """Outward normals (n_faces, 3) of the length of the area, m2, of faces of these corners (n_faces, 4, 3), m."""
    return np.asarray(0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]))


def _find_contact_faces(
    nodes: Floats, faces: Places, positions: Floats, flank: Places
) -> tuple[Places, Places, Places, Floats]:
    """`flank`, `contact_nodes`, `pairs`, `normals` of a surface. flank (n_contact,): contact surface of each pair."""
    distance, nearest = cKDTree(positions).query(nodes)
    stands = distance <= _SAME * np.linalg.norm(np.ptp(nodes, axis=0))
    of_faces = np.where(stands[faces].all(axis=1), flank[nearest[faces[:, 0]]], -1)
    of_faces[(flank[nearest[faces]] != of_faces[:, None]).any(axis=1)] = -1
    touching, normals = faces[of_faces >= 0], np.zeros_like(nodes)
    np.add.at(normals, touching, face_normals(nodes[touching])[:, None, :])
    used = np.unique(touching)
    normals = normals[used] / np.maximum(np.linalg.norm(normals[used], axis=1, keepdims=True), 1e-300)
    return of_faces, used, nearest[used], normals


# --- from where it is looked at ---


@dataclass(frozen=True)
class View:
    """Faces that are seen and the direction they are seen from.

    title: in words. faces (n_faces,): which are seen. to_eye, up (3,): unit vectors. body: the one in the view, or -1.
    """

    title: str
    faces: NDArray[np.bool_]
    to_eye: Floats
    up: Floats
    body: int = -1

    def seen(self, places: Floats) -> Floats:
        """Places (..., 3), m, on paper (..., 2), mm."""
        up = self.up - (self.up @ self.to_eye) * self.to_eye
        up /= np.linalg.norm(up)
        return 1e3 * np.stack([places @ np.cross(up, self.to_eye), places @ up], axis=-1)


def find_views(surface: RootSurface) -> tuple[View, ...]:
    """Close-ups of the contact surfaces of the outermost body, then the whole."""
    up, contact = _upwards(surface.nodes), surface.flank >= 0
    # outermost by where it is along the direction upwards
    bodies = np.unique(surface.body[contact]).tolist()
    nodes = [surface.nodes[np.unique(surface.faces[surface.body == body])] for body in bodies]
    outer = bodies[int(np.argmax([(each @ up).mean() for each in nodes]))]
    flanks = np.unique(surface.flank[(surface.body == outer) & contact]).tolist()[:_MOST_CLOSE_UPS]
    return (*(_close_up(surface, outer, flank, up) for flank in flanks), from_aslant(surface.nodes, len(surface.faces)))


def from_aslant(nodes: Floats, n_faces: int) -> View:
    """All faces of a mesh of these nodes (n_nodes, 3), from aslant."""
    up = _upwards(nodes)
    place = int(np.argmax(np.abs(up)))
    to_eye = np.roll(_WHOLE, place) * np.where(np.arange(3) == place, up[place], 1.0)
    return View("whole mesh", np.ones(n_faces, dtype=np.bool_), to_eye / np.linalg.norm(to_eye), up)


def _close_up(surface: RootSurface, body: int, flank: int, up: Floats) -> View:
    """The faces of a body around its contact surfaces, without those that stand before the one looked at."""
    of_body = surface.body == body
    inside = surface.nodes[np.unique(surface.faces[of_body & (surface.flank >= 0)])]
    looked_at = of_body & (surface.flank == flank)
    normal = face_normals(surface.nodes[surface.faces[looked_at]]).sum(axis=0)
    normal /= max(float(np.linalg.norm(normal)), 1e-300)
    size = float(np.linalg.norm(np.ptp(inside, axis=0)))
    low, high = inside.min(axis=0) - _AROUND * size, inside.max(axis=0) + _AROUND * size
    near = ((surface.nodes >= low) & (surface.nodes <= high)).all(axis=1)[surface.faces].any(axis=1)
    on_it = surface.nodes[np.unique(surface.faces[looked_at])]
    centre = surface.nodes[surface.faces].mean(axis=1)
    behind = centre @ normal <= float((on_it @ normal).max()) + _BEFORE * size
    # looked at from a side and from above
    aside = np.cross(up, normal)
    if np.linalg.norm(aside) < 0.1:
        # a surface that looks upwards or downwards
        other = np.eye(3)[np.argmin(np.abs(up))]
        aside, up = np.cross(other, normal), other
    to_eye = normal + _ASLANT * aside / np.linalg.norm(aside) + _FROM_ABOVE * up
    title = f"{surface.bodies[body]}: {surface.flanks[flank] or 'contact'}"
    return View(title, of_body & near & behind | looked_at, to_eye / np.linalg.norm(to_eye), up, body)


def _upwards(nodes: Floats) -> Floats:
    """Along the longest axis of the mesh, away from the origin: outwards in a sector whose blade stands on an axis."""
    up = np.zeros(3)
    place = int(np.argmax(np.round(np.ptp(nodes, axis=0), 9)))
    up[place] = -1.0 if nodes[:, place].mean() < 0.0 else 1.0
    return up


# --- on paper ---


def body_colours(names: tuple[str, ...]) -> tuple[str, ...]:
    """One colour a body; blade and disk have those of the other pictures of the mesh."""
    return tuple(_NAMED.get(name.lower(), _BODIES[number % len(_BODIES)]) for number, name in enumerate(names))


def rgb(names: tuple[str, ...], which: Places) -> Floats:
    """Colours (n, 3) of bodies of these names and places among them (n,)."""
    return np.array([to_rgb(colour) for colour in body_colours(names)])[which]


def paint_faces(
    panel: Axes, corners: Floats, colours: Floats, view: View, whole: Floats | None = None, n_plain: int = 0
) -> None:
    """Faces (n, 4, 3), m, with colours (n, 3) as seen in a view, in mm; inner sides, where a mesh is cut, are grey.

    n_plain: of the last ones, whose colours are values: they have no shade and no edges. whole (n, 3): middles of the
    faces, or of those that they are pieces of.
    """
    order = np.argsort((corners.mean(axis=1) if whole is None else whole) @ view.to_eye, kind="stable")
    normals = face_normals(corners)
    turned = normals @ view.to_eye / np.maximum(np.linalg.norm(normals, axis=1), 1e-300)
    plain = np.arange(len(corners)) >= len(corners) - n_plain
    shade = np.where(plain, 1.0, 0.55 + 0.45 * np.abs(turned))
    lit = np.where((turned < -_EDGEWAYS)[:, None], _INSIDE, colours * shade[:, None])
    edges = np.where(plain[:, None], lit, _EDGES)
    look: dict[str, Any] = {"facecolors": lit[order], "edgecolors": edges[order], "linewidths": 0.2}
    panel.add_collection(PolyCollection(list(view.seen(corners[order])), rasterized=True, **look))
    panel.set_aspect("equal")
    panel.autoscale_view()
    panel.grid(visible=False)
    panel.set_axis_off()


def draw_scale_bar(panel: Axes, nodes: Floats, view: View) -> None:
    """A bar of a round length under what is seen, in place of axes."""
    low, high = (end(view.seen(nodes), axis=0) for end in (np.min, np.max))
    size = float((high - low).max())
    if not size > 0.0:
        return
    length = _round_below(0.4 * size)
    bottom, middle = low[1] - 0.05 * size, low[0] + 0.5 * length
    panel.plot([low[0], low[0] + length], [bottom, bottom], color="0.1", linewidth=2.5, label="_")
    panel.text(middle, bottom - 0.02 * size, f"{length:g} mm", ha="center", va="top")
    panel.set_ylim(bottom - 0.1 * size, high[1] + 0.02 * size)


# --- for ParaView ---


def find_writer(result: Result) -> Callable[[Path], int]:
    """What writes the series into a folder. Raises UserError without the library, or without anything to draw."""
    if find_spec("meshio") is None:
        remedy = "install the library: pip install meshio"
        raise UserError("command line", "--vtu", Verbatim("needs meshio, which is not installed"), remedy)
    result = of_shown_scene(result)
    surface = read_root(result) if result.has_slow_time else None
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

    shown, at_points = result.shown, dict[str, Floats]()
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
            at_nodes[surface.contact_nodes] = values[number][surface.pairs]
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
