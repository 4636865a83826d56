"""Matrices come out of the files of the codes as they went in."""

import re

import numpy as np
import pytest

from studies.fe_models.deck.read import read_deck
from studies.fe_models.matrices import nastran
from studies.fe_models.matrices.read import find_matrix_files, read_matrices
from studies.scene_error import SceneError
from tests.studies.fe_models.decks import SECTOR
from tests.studies.fe_models.matrix_files import chain, needs_ccx, run_ccx, write_abaqus, write_calculix, write_nastran
from tests.studies.fe_models.mutations import mutate


def check(read, nodes, rtol):
    """The matrices of `chain`, whose rows the reader sorts by node."""
    stiffness, mass, node, direction = chain(nodes)
    order = np.lexsort((direction, node))
    assert read.node.tolist() == node[order].tolist()
    assert (read.direction + 1).tolist() == direction[order].tolist()
    for found, expected in ((read.stiffness, stiffness), (read.mass, mass)):
        np.testing.assert_allclose(found.toarray(), expected[np.ix_(order, order)], rtol=rtol)


def test_calculix(tmp_path):
    # 1.1 and 10.1: read as numbers, node 10 would be node 1, and 1.10 a direction
    read = read_matrices(write_calculix(tmp_path, nodes=(1, 10, 100)))
    check(read, (1, 10, 100), 1e-13)
    assert (read.code, read.files) == ("calculix", ("job.sti", "job.mas", "job.dof"))


@pytest.mark.parametrize("triangles", ["lower", "upper", "both"])
def test_abaqus(tmp_path, triangles):
    read = read_matrices(write_abaqus(tmp_path, triangles=triangles))
    check(read, (1, 2, -7), 1e-14)
    assert read.files == ("job_STIF1.mtx", "job_MASS1.mtx")


@pytest.mark.parametrize(("large", "rtol"), [(True, 1e-9), (False, 6e-4)])
def test_nastran(tmp_path, large, rtol):
    check(read_matrices(write_nastran(tmp_path, large=large)), (1, 2, 10), rtol)


def test_names_of_files(tmp_path):
    job = write_calculix(tmp_path)
    assert [path.suffix for path in find_matrix_files(job)] == [".sti", ".mas", ".dof"]
    assert find_matrix_files(tmp_path / "job.mas") == find_matrix_files(job)
    write_abaqus(tmp_path)
    with pytest.raises(SceneError, match=r"there are job.sti and job_STIF1.mtx; give the name of one"):
        read_matrices(job)
    assert read_matrices(tmp_path / "job_MASS1.mtx").code == "abaqus"
    with pytest.raises(SceneError, match=r"there is no other.sti, other_STIF1.mtx"):
        read_matrices(tmp_path / "other")


def edit(path, old, new, count=1):
    text = path.read_text()
    changed = re.sub(old, new, text, count=count, flags=re.MULTILINE)
    assert changed != text
    path.write_text(changed)


@pytest.mark.parametrize(
    ("end", "old", "new", "sentence"),
    [
        ("sti", r"^2 2 .*", "2 2 nan", r"job.sti: line 3 is '2 2 nan'"),
        ("sti", r"^1 2 (.*)", r"1 2 \1\n1 2 \1", "job.sti: 1 entries are given twice"),
        ("sti", r"^1 2 (.*)", r"1 2 \1\n2 1 0.0", "job.sti: the matrix is not symmetric"),
        ("sti", r"^9 9 ", "1000000000 9 ", "job.sti: 1000000000 rows for 9 dofs in job.dof"),
        ("dof", r"10.3\n", "", "job.sti: 9 rows for 8 dofs in job.dof"),
        ("dof", r"10.3", "10.2", r"job.sti: dof 2 of node 10 has two rows"),
    ],
)
def test_wrong_files_of_calculix(tmp_path, end, old, new, sentence):
    job = write_calculix(tmp_path)
    edit(job.with_suffix(f".{end}"), old, new)
    with pytest.raises(SceneError, match=sentence):
        read_matrices(job)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        (r"^1,1, 1,1, .*", "1,1, 1,1, 1e36", "1 entries of the diagonal are 1e36: boundary conditions were active"),
        (r"^1,1, 1,1,", "1,4, 1,4,", "node 1 has the dof 4"),
        (r"^1,1, 1,1,", "0,1, 0,1,", "a node with the number 0"),
        (r"^1,1, 1,1,", "9999999999999,1, 1,1,", "job_STIF1.mtx: node 9999999999999"),
    ],
)
def test_wrong_files_of_abaqus(tmp_path, old, new, sentence):
    job = write_abaqus(tmp_path)
    edit(tmp_path / "job_STIF1.mtx", old, new)
    with pytest.raises(SceneError, match=sentence):
        read_matrices(job)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("KAAX           0       6       2", "KAAX           0       6       4", "line 3 says that KAAX is complex"),
        ("KAAX           0", "LAAX           0", "line 4 is a column of KAAX, whose header is missing"),
        (r"\*(\s+)1(\s+)1 ", r"*\g<1>1\g<2>4 ", "node 1 has the dof 4"),
        ("D[+]10", "D+10         1.0D+10", "has an imaginary part"),
        (
            "KAAX           0       6",
            "KAAX           0       1",
            r"KAAX is square .* \(form 1\), and has one triangle only",
        ),
        (
            "GRID,1,,0.,0.,0.",
            "GRID,1,,0.,0.,0.,3",
            r"line 2: GRID 1 has displacements in the coordinate system 3 \(CD\)",
        ),
    ],
)
def test_wrong_files_of_nastran(tmp_path, old, new, sentence):
    job = write_nastran(tmp_path)
    edit(job.with_suffix(".pch"), old, new, 0 if "AAX" in old and "AX " not in old else 1)
    with pytest.raises(SceneError, match=sentence):
        read_matrices(job)


@pytest.mark.parametrize("form", [1, 6])
def test_a_square_matrix_of_nastran(tmp_path, form):
    """Both triangles under form 1 are one matrix; a diagonal matrix has no triangle."""
    job = write_nastran(tmp_path)
    stiffness, mass, node, direction = chain()
    lines = []
    for title, matrix in (("KAAX", stiffness), ("MAAX", np.diag(np.diag(mass)))):
        lines.append(f"{'DMIG':8}{title:8}{0:8d}{form if title == 'MAAX' else 1:8d}{2:8d}{0:8d}")
        for column in range(len(matrix)):
            lines.append(f"{'DMIG*':8}{title:16}{node[column]:16d}{direction[column]:16d}")
            for row in np.flatnonzero(matrix[:, column]):
                lines.append(f"{'*':8}{node[row]:16d}{direction[row]:16d}{matrix[row, column]:16.9E}")
    job.with_suffix(".pch").write_text("\n".join(lines) + "\n")
    read = read_matrices(job)
    np.testing.assert_allclose(read.stiffness.toarray(), stiffness, rtol=1e-8)
    np.testing.assert_allclose(read.mass.toarray(), np.diag(np.diag(mass)), rtol=1e-8)


@pytest.mark.parametrize("line", ["1 1 2.5e9\n", "  1,  1,  2.5e9\n", "** a matrix\n12 3 1.0\n"])
def test_matrices_of_abaqus_without_nodes(tmp_path, line):
    job = write_abaqus(tmp_path)
    (tmp_path / "job_MASS1.mtx").write_text(line)
    with pytest.raises(SceneError, match=r"job_MASS1.mtx: line . has a row.*COORDINATE.*; write .*FORMAT=MATRIX INPUT"):
        read_matrices(job)


@pytest.mark.parametrize("name", ["job", "job.op4"])
def test_op4_is_named(tmp_path, name):
    (tmp_path / "job.op4").write_bytes(b"1")
    with pytest.raises(
        SceneError, match=r"job.op4 is an OP4 file of Nastran.*; punch the matrices: PARAM,EXTOUT,DMIGPCH"
    ):
        read_matrices(tmp_path / name)


WRITERS = {
    "job.sti": write_calculix,
    "job.mas": write_calculix,
    "job.dof": write_calculix,
    "job_STIF1.mtx": write_abaqus,
    "job_MASS1.mtx": write_abaqus,
    "job.pch": write_nastran,
}


@pytest.mark.parametrize("name", WRITERS)
def test_damaged_matrices(tmp_path, monkeypatch, name):
    """What is read is symmetric and finite; what is not ends in a sentence that names the file."""
    monkeypatch.setattr(nastran, "_AT_ONCE", 5)
    job = WRITERS[name](tmp_path)
    good = (tmp_path / name).read_bytes()
    said: list[str] = []
    for seed in range(40):
        (tmp_path / name).write_bytes(mutate(good, seed))
        try:
            read = read_matrices(job)
        except SceneError as error:
            said.append(str(error))
            continue
        for matrix in (read.stiffness, read.mass):
            assert matrix.shape == (read.node.size,) * 2
            assert np.isfinite(matrix.data).all()
            assert abs(matrix - matrix.T).max() == 0
        assert set(read.direction) <= {0, 1, 2}
    assert len(said) > 5
    assert all(sentence.startswith("matrices: job") and sentence.isprintable() for sentence in said)


@needs_ccx
def test_sector_of_calculix(tmp_path):
    read = read_matrices(run_ccx(tmp_path, SECTOR.read_text()))
    deck = read_deck(SECTOR)
    # all dofs are there: of 129 nodes, those that are tied, fixed and cyclic included
    assert read.stiffness.shape == read.mass.shape == (3 * 129, 3 * 129)
    np.testing.assert_array_equal(read.node, np.repeat(deck.node_numbers, 3))
    np.testing.assert_array_equal(read.direction, np.tile([0, 1, 2], 129))
    for matrix in (read.stiffness, read.mass):
        assert abs(matrix - matrix.T).max() == 0
    # density times the volume of the hexahedra, by their diagonals (van Oosterom's formula needs no code of ours)
    corners = deck.coordinates[deck.rows_of_nodes(np.concatenate([block.nodes for block in deck.blocks]))]
    tetrahedra = corners[:, [[0, 1, 3, 4], [1, 2, 3, 6], [1, 3, 4, 6], [1, 4, 5, 6], [3, 4, 6, 7]]]
    edges = tetrahedra[:, :, 1:] - tetrahedra[:, :, :1]
    volume = abs(np.linalg.det(edges)).sum() / 6
    assert read.mass.sum() / 3 == pytest.approx(7800 * volume, rel=1e-9)
    assert np.linalg.eigvalsh(read.mass.toarray()).min() > 0


def test_large_fields_are_read_in_arrays(tmp_path, monkeypatch):
    """Arrays take what `_line` takes line by line, and leave to it what it refuses."""
    taken: list[bool] = []
    plain_lines = nastran._Reader._plain_lines

    def watched(reader, lines):
        taken.append(plain_lines(reader, lines))
        return taken[-1]

    monkeypatch.setattr(nastran, "_AT_ONCE", 5)
    monkeypatch.setattr(nastran._Reader, "_plain_lines", watched)
    job = write_nastran(tmp_path)
    check(read_matrices(job), (1, 2, 10), 1e-9)
    assert 10 < taken.count(True) < len(taken)
    text = job.with_suffix(".pch").read_text()
    for old, new in (("D-", "X-"), ("DMIG*   MAAX   ", "DMIG*   KAAX   ")):
        last = text.rindex(old)
        job.with_suffix(".pch").write_text(text[:last] + new + text[last + len(old) :])
        with pytest.raises(SceneError, match=r"job.pch: (line \d+ |\d entries are given twice)"):
            read_matrices(job)
