"""The log of a run under mpiexec says how far it is, again and again."""

from tests.mpi.launching import CHEAP, FAKED, run_to_end
from tests.studyrunner.test_progress import LINE


def test_a_run_on_two_ranks_says_how_far_it_is(tmp_path):
    """Both ranks are seen at work, and the rank that serves them is not too busy to say so."""
    study = (*CHEAP, "--set", "axes.scheme=['implicit', 'explicit']", "-o", "out.nc")
    told = {"FAKE_STEPS": "4", "FAKE_SECONDS": "0.03", "FAKE_TELLING": "0.1"}
    ended = run_to_end(2, [FAKED, *study], tmp_path, told)
    assert ended.status == 0, ended.said
    found = [match for line in ended.said.splitlines() if (match := LINE.fullmatch(line))]
    assert len(found) >= 5, ended.said
    assert all(match["left"] for match in found[:-1])
    done = [int(match["done"]) for match in found]
    assert done == sorted(done)
    assert done[0] < done[-1]
    assert int(found[0]["percent"]) < int(found[-1]["percent"])
    assert max(len(match["running"].split(", ")) for match in found if match["running"]) == 2, ended.said
