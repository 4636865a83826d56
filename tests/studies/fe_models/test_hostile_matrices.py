"""Whatever files with matrices hold: they are read, or refused in one sentence, soon."""

import time

import numpy as np
import pytest

from studies.fe_models.matrices import nastran
from studies.fe_models.matrices.read import read_matrices
from studies.scene_error import SceneError
from tests.studies.fe_models.matrix_files import write_abaqus, write_calculix, write_nastran
from tests.studies.fe_models.mutations import mutate

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
    for seed in range(60):
        (tmp_path / name).write_bytes(mutate(good, seed))
        began = time.process_time()
        try:
            read = read_matrices(job)
        except SceneError as error:
            said.append(str(error))
            continue
        finally:
            assert time.process_time() - began < 2
        for matrix in (read.stiffness, read.mass):
            assert matrix.shape == (read.node.size,) * 2
            assert np.isfinite(matrix.data).all()
            assert abs(matrix - matrix.T).max() == 0
        assert set(read.direction) <= {0, 1, 2}
    assert len(said) > 5
    assert all(sentence.startswith("matrices: job") and sentence.isprintable() for sentence in said)


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("job.sti", b"", "job.sti: the file is empty"),
        ("job.sti", b"\x00" * 10_000, "job.sti"),
        ("job.sti", b"1 " * 500_000, "job.sti: line 1 is very long"),
        ("job.sti", b"999999999999999999 1 1.0\n", "job.sti: 999999999999999999 rows for 9 dofs"),
        ("job.sti", b"-5 1 1.0\n", "job.sti: a row or column below 1"),
        ("job_STIF1.mtx", b"*" * 100_000, "job_STIF1.mtx: line 1 is very long"),
        ("job_STIF1.mtx", b"-9223372036854775808,1,1,1,1.0\n", "job_STIF1.mtx: "),
        ("job.pch", b"DMIG" * 100_000, "job.pch: line 1 is no text, or very long"),
        ("job.pch", b"DMIG    KAAX           0       6       2\n" * 2, "job.pch: line 2 begins KAAX again"),
        ("job.pch", b"$\n", "job.pch: no matrix KAAX but none"),
    ],
)
def test_hostile_matrices(tmp_path, name, content, sentence):
    job = WRITERS[name](tmp_path)
    (tmp_path / name).write_bytes(content)
    began = time.process_time()
    with pytest.raises(SceneError, match=sentence) as wrong:
        read_matrices(job)
    assert time.process_time() - began < 2
    assert len(str(wrong.value)) < 300


def test_too_many_entries(tmp_path, monkeypatch):
    for module in ("columns", "nastran"):
        monkeypatch.setattr(f"studies.fe_models.matrices.{module}.LARGEST_ENTRIES", 20)
    for folder, write in (("calculix", write_calculix), ("abaqus", write_abaqus), ("nastran", write_nastran)):
        (tmp_path / folder).mkdir()
        with pytest.raises(SceneError, match="more than 20 entries; reduce the model"):
            read_matrices(write(tmp_path / folder))


def test_missing_file(tmp_path):
    job = write_calculix(tmp_path)
    (tmp_path / "job.mas").unlink()
    with pytest.raises(SceneError, match=r"matrices: job.mas: there is no such file"):
        read_matrices(job)
    (tmp_path / "zero.pch").symlink_to("/dev/zero")
    with pytest.raises(SceneError, match=r"matrices: zero.pch: there is no such file"):
        read_matrices(tmp_path / "zero.pch")
