"""Files that other libraries read; skipped where the library is not installed."""

import importlib.util
import struct
import sys

import meshio
import numpy as np
import pytest

from studies.fe_models.matrices.read import read_matrices
from studies.fe_models.meshes import read_mesh_file
from studies.scene_error import SceneError
from tests.studies.fe_models.decks import SECTOR, write
from tests.studies.fe_models.plates import Plates

needs_ansys = pytest.mark.skipif(importlib.util.find_spec("ansys") is None, reason="ansys-mapdl-reader is not there")
GMSH_41 = SECTOR.with_name("two_tetrahedra.msh").read_text(encoding="ascii")


def binary_41(text):
    """The same file in binary, with a node that has a parameter."""
    sizes = {"Entities": "qqqq iddddddqiq iddddddqiq", "Nodes": "qqqq iiiq qqqqq " + 5 * "ddd"}
    sizes["Elements"] = "qqqq iiiq qqqq iiiq qqqqq qqqqq"
    content = text.replace("4.1 0 8", "4.1 1 8\n@").encode()
    for name, kinds in sizes.items():
        first, rest = content.split(f"${name}\n".encode())
        numbers, rest = rest.split(f"$End{name}".encode())
        packed = struct.pack("<" + kinds.replace(" ", ""), *map(eval, numbers.split()))
        content = b"".join((first, f"${name}\n".encode(), packed, f"\n$End{name}".encode(), rest))
    return content.replace(b"@", struct.pack("<i", 1))


@pytest.mark.parametrize("content", [GMSH_41.encode(), binary_41(GMSH_41)], ids=["text", "binary"])
def test_gmsh_41_and_what_is_no_mesh(tmp_path, content):
    (tmp_path / "mesh.msh").write_bytes(content)
    deck = read_mesh_file(tmp_path / "mesh.msh")
    assert [(block.kind, block.nodes.tolist()) for block in deck.blocks] == [("C3D4", [[1, 2, 3, 4], [2, 3, 4, 5]])]
    sets = {name: nodes.tolist() for name, nodes in deck.node_sets.items()}
    assert sets == {"UNDER": [1, 2, 3], "BLOCK": [1, 2, 3, 4, 5]}
    assert deck.element_sets["BLOCK"].tolist() == [1, 2]
    with pytest.raises(SceneError, match=r"^model: mesh.med "):
        read_mesh_file(tmp_path / "mesh.med")
    with pytest.raises(SceneError, match=r"^model: .*none.cdb"):
        read_mesh_file(tmp_path / "none.cdb")
    damaged = (content[:-40], content.replace(b"4.1", b"4.0"), content.replace(b"$EndNodes", b""))
    texts = GMSH_41.replace("1 5 1 5", "1 5 x 5"), GMSH_41.replace("\n5\n0 0 0", "\n7\n0 0 0")
    for each in (*damaged, *map(str.encode, texts)):
        (tmp_path / "mesh.msh").write_bytes(each)
        with pytest.raises(SceneError, match=r"^model: mesh.msh "):
            read_mesh_file(tmp_path / "mesh.msh")


@pytest.mark.parametrize("binary", [False, True])
def test_gmsh_22_as_meshio_writes_it(tmp_path, binary):
    expected = read_mesh_file(write(tmp_path, Plates().gmsh(), "lap.msh"))
    meshio.write(tmp_path / "own.msh", meshio.read(tmp_path / "lap.msh", "gmsh"), "gmsh22", binary=binary)
    found = read_mesh_file(tmp_path / "own.msh")
    np.testing.assert_array_equal(found.coordinates, expected.coordinates)
    for one, other in zip(found.blocks, expected.blocks, strict=True):
        np.testing.assert_array_equal(one.nodes, other.nodes)
    for name in ("node_sets", "element_sets"):
        one, other = getattr(found, name), getattr(expected, name)
        assert {key: each.tolist() for key, each in one.items()} == {key: each.tolist() for key, each in other.items()}


def write_cdb(folder, commands, types):
    """A cube with two components, as CDWRITE writes it."""
    corners = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    nodes = [f"{n:9d}{0:9d}{0:9d}" + "".join(f"{v:21.13E}" for v in at) for n, at in enumerate(corners, 1)]
    element = "".join(f"{v:9d}" for v in (1, 1, 1, 1, 0, 0, 0, 0, 8, 0, 5, *range(1, 9)))
    component = ("CMBLOCK,FOOT    ,NODE,        2", "(8i10)", f"{1:10d}{-4:10d}")
    lines = [
        *("/COM,ANSYS RELEASE 2023 R1", "/PREP7", "*IF,_CDRDOFF,EQ,1,THEN", "_CDRDOFF=", "*ENDIF", "DOF,DELETE"),
        *(types.rstrip("\n"), "NBLOCK,6,SOLID,        8,        8", "(3i9,6e21.13e3)", *nodes, "N,R5.3,LOC,       -1,"),
        *("EBLOCK,19,SOLID,        1,        1", "(19i9)", element, "       -1", *component),
        *("TREF,  0.00000000    ", "ACEL,  0.0,0.0,0.0", "BFUNIF,TEMP,_TINY", "PSTRES,OFF", commands, "FINISH"),
    ]
    return write(folder, "\n".join(lines) + "\n", "mesh.cdb")


ETBLOCK = (
    "ETBLOCK,        1,        1\n(2i9,19a9)\n" + "".join(f"{v:9d}" for v in (1, 185, *[0] * 19)) + "\n       -1\n"
)


@needs_ansys
@pytest.mark.parametrize("types", ["ET,1,185\n", "ET,1,SOLID185\n", ETBLOCK])
def test_cdb(tmp_path, types):
    deck = read_mesh_file(write_cdb(tmp_path, "D,      1,UX  ,  0.0    ,  0.0\nD,2,ALL\nKEYOPT,1,2,3", types))
    (block,) = deck.blocks
    assert (block.kind, block.numbers.tolist(), block.nodes.tolist()) == ("C3D8I", [5], [list(range(1, 9))])
    assert deck.node_sets["FOOT"].tolist() == [1, 2, 3, 4]
    held = [(each.nodes.tolist(), each.first_dof, each.last_dof, each.value) for each in deck.boundaries]
    assert held == [([1], 1, 1, 0.0), ([2], 1, 3, 0.0)]


@pytest.mark.parametrize("form", ["9,COMPACT,,32", "10,,,1"])
def test_elements_of_a_cdb_in_another_form(tmp_path, form):
    """Without the library as well."""
    path = write_cdb(tmp_path, "", "ET,1,185")
    path.write_text(path.read_text().replace("19,SOLID,        1,        1", form))
    with pytest.raises(SceneError, match=rf"mesh.cdb, line 19: EBLOCK,{form}: elements in this form .*EBLOCK,19,SOLID"):
        read_mesh_file(path)


def test_missing_libraries(tmp_path, monkeypatch):
    for library in ("ansys.mapdl", "ansys.mapdl.reader"):
        monkeypatch.setitem(sys.modules, library, None)
    (tmp_path / "job.full").write_bytes(b"1")
    with pytest.raises(SceneError, match="pip install ansys-mapdl-reader"):
        read_matrices(tmp_path / "job")


# edges of the mid-side nodes, from corners counted from 0, by the manuals of Gmsh and of CalculiX
ORDERS = {
    "C3D10": (
        11,
        ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
        ((0, 1), (1, 2), (2, 0), (3, 0), (2, 3), (1, 3)),
        ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    ),
    "C3D15": (
        18,
        ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)),
        ((0, 1), (0, 2), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (3, 5), (4, 5)),
        ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
    ),
    "C3D20": (
        17,
        ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)),
        (*((0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3)), *((2, 6), (3, 7), (4, 5), (4, 7), (5, 6), (6, 7))),
        (*((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6)), *((6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))),
    ),
}


@pytest.mark.parametrize("kind", ORDERS)
def test_order_of_mid_side_nodes(tmp_path, kind):
    number, corners, edges, expected = ORDERS[kind]
    points = np.array([*corners, *(np.mean([corners[a], corners[b]], axis=0) for a, b in edges)])
    nodes = "\n".join(f"{n} {x} {y} {z}" for n, (x, y, z) in enumerate(points, 1))
    element = " ".join(map(str, range(1, len(points) + 1)))
    head = f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{len(points)}\n{nodes}\n$EndNodes\n"
    text = f"{head}$Elements\n1\n1 {number} 2 1 1 {element}\n$EndElements\n"
    deck = read_mesh_file(write(tmp_path, text, "mesh.msh"))
    (block,) = deck.blocks
    found = deck.coordinates[deck.rows_of_nodes(block.nodes[0])]
    assert block.kind == kind
    np.testing.assert_array_equal(found[: len(corners)], corners)
    np.testing.assert_array_equal(found[len(corners) :], [(found[a] + found[b]) / 2 for a, b in expected])
