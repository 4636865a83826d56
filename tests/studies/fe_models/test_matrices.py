"""Matrices come out of the files of the codes as they went in."""

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy import io

from solver import build_model
from studies.fe_models.matrices.read import find_matrix_files, read_matrices
from studies.finite_element.solid_mesh import assemble_stiffness
from studies.model_check import check_model
from studies.scene_error import SceneError
from tests.studies.fe_models.decks import mutate
from tests.studies.fe_models.matrix_files import REDUCED, chain, write_calculix, write_matrix_input, write_punch
from tests.studies.fe_models.solid_meshes import block, deck_lines, needs_ccx, run_ccx

FORMATS = {
    # 1.1 and 10.1: read as numbers, node 10 would be node 1, and 1.10 a direction
    "calculix": (write_calculix, chain((1, 10, 100)), 1e-13),
    "upper": (partial(write_matrix_input, triangles="upper"), chain((1, 2, -7)), 1e-14),
    "both": (partial(write_matrix_input, triangles="both"), chain((1, 2, -7)), 1e-14),
    "short punch": (partial(write_punch, large=False), chain(), 6e-4),
    # a punch file has ten digits
    **{name: (each, chain(n_modes=2), 1e-9 if name == "punch" else 1e-13) for name, each in REDUCED.items()},
}
WITHOUT = {"calculix": ("damping", "load"), "user element": ("load",)}


@pytest.mark.parametrize("name", FORMATS)
def test_matrices_come_out_as_they_went_in(name, tmp_path):
    """The reader sorts rows by node."""
    write, (named, rows), rtol = FORMATS[name]
    write(tmp_path, named, rows)
    read = read_matrices(tmp_path / "job")
    order = np.lexsort((rows[:, 1], rows[:, 0]))
    np.testing.assert_array_equal(np.stack([read.node, read.direction + 1], axis=1), rows[order])
    for part in set(named) - set(WITHOUT.get(name, ())):
        found, expected = getattr(read, part), named[part][order]
        found, expected = (found[:, 0], expected) if part == "load" else (found.toarray(), expected[:, order])
        np.testing.assert_allclose(found, expected, rtol=rtol)


def test_names_of_files(tmp_path):
    job = tmp_path / "job"
    write_calculix(tmp_path, *chain())
    assert [path.suffix for path in find_matrix_files(job)] == [".sti", ".mas", ".dof"]
    assert find_matrix_files(tmp_path / "job.mas") == find_matrix_files(job)
    write_matrix_input(tmp_path, *chain())
    with pytest.raises(SceneError, match=r"^matrices: .*job.sti and job_STIF1.mtx;"):
        read_matrices(job)
    assert read_matrices(tmp_path / "job_MASS1.mtx").code == "abaqus"
    with pytest.raises(SceneError, match=r"^matrices: .* other.sti, .*other_STIF1.mtx"):
        read_matrices(tmp_path / "other")


WRITERS = {
    "job.sti": write_calculix,
    "job.dof": write_calculix,
    "job_STIF1.mtx": write_matrix_input,
    "job.pch": write_punch,
    "job.mtx": REDUCED["user element"],
    "job.mat": REDUCED["mat"],
    "job.op4": REDUCED["op4 binary sparse"],
    "job_mass.mtx": REDUCED["market"],
    "job_stiffness.hb": REDUCED["one triangle"],
}


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("job.sti", r"^1 2 (.*)", r"1 2 \1\n1 2 \1"),
        ("job.sti", r"^1 2 (.*)", r"1 2 \1\n2 1 0.0"),
        ("job.sti", r"^2 2 .*", "2 2 x"),
        ("job.dof", r"10.3", "10.2"),
        ("job.sti", r"^1 1 .*\n", "10 10 1.0\n"),
        ("job_STIF1.mtx", r"^1,1, 1,1, .*", "1,1, 1,1, 1e36"),
        ("job_STIF1.mtx", r"^1,1, 1,1,", "0,1, 0,1,"),
        ("job_STIF1.mtx", r"(?s).*", "1 1 2.5e9\n"),
        ("job.pch", "KAAX           0       6       2", "KAAX           0       6       4"),
        ("job.pch", "KAAX           0", "LAAX           0"),
        ("job.pch", "D[+]10", "D+10         1.0D+10"),
        ("job.pch", "GRID,1,,0.,0.,0.", "GRID,1,,0.,0.,0.,3"),
        ("job_mass.mtx", "real symmetric", "real skew-symmetric"),
        ("job_mass.mtx", "real symmetric", "pattern symmetric"),
        ("job_stiffness.hb", "RSA", "RZA"),
        ("job_stiffness.hb", r" 0\nRSA", " 2\nRSA"),
        ("job_stiffness.hb", r"(?s)[^\n]*\n$", ""),
    ],
)
def test_wrong_files_are_named(tmp_path, name, old, new):
    WRITERS[name](tmp_path, *chain())
    path = tmp_path / name
    changed = re.sub(old, new, path.read_text(), count=1, flags=re.MULTILINE)
    assert changed != path.read_text()
    path.write_text(changed)
    with pytest.raises(SceneError, match=f"^matrices: {name}: "):
        read_matrices(tmp_path / "job")


@pytest.mark.parametrize("kind", ["mat", "market"])
def test_tables_without_their_rows_or_with_complex_numbers(tmp_path, kind):
    named, rows = chain()
    stiffness = named["stiffness"]
    for matrix, of_rows in ((stiffness, rows[:-1]), (stiffness, np.ones_like(rows)), (stiffness * 1j, rows)):
        REDUCED[kind](tmp_path, {**named, "stiffness": matrix}, of_rows)
        with pytest.raises(SceneError, match=r"^matrices: job(\.mat|_stiffness\.mtx): "):
            read_matrices(tmp_path / "job")
    if kind == "mat":
        io.savemat(tmp_path / "job.mat", {"other": 1.0})
        with pytest.raises(SceneError, match=r"^matrices: job\.mat: "):
            read_matrices(tmp_path / "job")


BOTH = {name: REDUCED[name] for name in ("mat", "mat 7.3", "market", "harwell boeing", "op4", "op4 binary sparse")}
BOTH["matrix input"] = partial(write_matrix_input, triangles="both")


@pytest.mark.parametrize("name", ["stiffness", "mass", "damping"])
def test_a_boundary_that_is_not_symmetric_beside_stiff_modes(tmp_path, name):
    """Each entry is judged beside its own diagonal, whichever way the matrix comes in."""
    named, rows = chain(n_modes=2)
    named["damping"] = 0.1 * named["mass"]
    n, scale = len(rows), np.append(np.ones(len(rows) - 2), [1e4, 1e6])
    whole = {each: named[each] * np.outer(scale, scale) for each in ("mass", "damping", "stiffness")}
    model = build_model(*whole.values(), [[0, 1, 2]], 1.0, load_harmonic=np.eye(n)[0])
    matrix = whole[name].copy()
    matrix[0, 1] += 0.17 * np.sqrt(matrix[0, 0] * matrix[1, 1])
    wrong = whole | {name: matrix}
    for folder, write in BOTH.items():
        for part, given in (("right", whole), ("wrong", wrong)):
            (tmp_path / folder / part).mkdir(parents=True)
            write(tmp_path / folder / part, given | {"load": named["load"]}, rows)
        read_matrices(tmp_path / folder / "right" / "job")
        with pytest.raises(SceneError, match=" dof 1 of node 1 and dof 2 of node 1"):
            read_matrices(tmp_path / folder / "wrong" / "job")
    with pytest.raises(ValueError, match=rf"^{name}: .* \(0, 1\) "):
        build_model(*wrong.values(), [[0, 1, 2]], 1.0, load_harmonic=np.eye(n)[0])
    with pytest.raises(SceneError, match=f"^{name}: .* 0, 1 .* 1, 0"):
        check_model(replace(model, linear={0: replace(model.linear[0], **{name: matrix})}))


@needs_ccx
def test_a_substructure_of_calculix(tmp_path):
    """CalculiX holds the other nodes, and writes no mass, which is added here."""
    mesh, _ = block("C3D8", (2, 1, 1), lambda points: points * [0.04, 0.02, 0.005])
    kept = mesh.numbers[[0, 5, 7]]
    lines = [*deck_lines(mesh), "*STEP", "*SUBSTRUCTURE GENERATE", "*RETAINED NODAL DOFS,SORTED=NO"]
    lines += [*(f"{node},1,3" for node in kept), "*SUBSTRUCTURE MATRIX OUTPUT,FILE NAME=sub,OUTPUT FILE=USER DEFINED"]
    run_ccx(tmp_path, [*lines, "*END STEP"])
    with pytest.raises(SceneError, match=r"sub.mtx: no mass in the file"):
        read_matrices(tmp_path / "sub")
    triangle = "\n".join(f"{float(row == column)!r}," for column in range(9) for row in range(column + 1))
    with (tmp_path / "sub.mtx").open("a") as file:
        file.write("*MATRIX,TYPE=MASS\n" + triangle + "\n")
    read = read_matrices(tmp_path / "sub")
    assert read.node.tolist() == np.repeat(np.sort(kept), 3).tolist()
    own = np.flatnonzero(np.isin(np.repeat(mesh.numbers, 3), kept))
    expected = assemble_stiffness(mesh)[own][:, own].toarray()
    np.testing.assert_allclose(read.stiffness.toarray(), expected, atol=1e-9 * abs(expected).max())


@pytest.mark.parametrize("name", WRITERS)
def test_damaged_matrices(tmp_path, name):
    """What is read is symmetric and finite; what is not ends in a sentence that names the file."""
    WRITERS[name](tmp_path, *chain())
    path = tmp_path / name
    good, said = path.read_bytes(), []
    for seed in range(25):
        path.write_bytes(mutate(good, seed))
        try:
            read = read_matrices(tmp_path / "job")
        except SceneError as error:
            said.append(str(error))
            continue
        for matrix in (read.stiffness, read.mass):
            assert matrix.shape == (read.node.size,) * 2
            assert np.isfinite(matrix.data).all()
            assert abs(matrix - matrix.T).max() == 0
    assert len(said) > 3
    assert all(sentence.startswith("matrices: job") and sentence.isprintable() for sentence in said)
