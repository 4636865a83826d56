"""Some fuzzed scene, deck and result files: no traceback and no hang; `fuzz_files` tries thousands."""

from collections import Counter

import pytest

from tests.studyrunner.fuzzing import answers, write_whole_files


@pytest.mark.slow
@pytest.mark.parametrize(("n_files", "kinds"), [(18, ("scene", "result", "deck")), (6, ("report", "reader"))])
def test_fuzzed_files(n_files, kinds, tmp_path):
    write_whole_files(tmp_path)
    found = answers(tmp_path, 1, range(n_files), kinds)
    assert [answer.wrong for answer in found if answer.wrong] == []
    assert len(found) == n_files
    # most of them are wrong, and not all: those that are would say little otherwise
    ended = Counter(answer.ended.split()[-1] for answer in found)
    assert ended["2"] > n_files / 20
    assert ended["0"] > 0
