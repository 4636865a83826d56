"""Some fuzzed scene, deck and result files: no traceback and no hang; `fuzz_files` tries thousands."""

from collections import Counter

import pytest

from tests.studyrunner.fuzzing import FILES, answers, write_whole_files


@pytest.mark.slow
def test_fuzzed_files(tmp_path):
    (tmp_path / "whole").mkdir()
    write_whole_files(tmp_path / "whole")
    found = answers(tmp_path / "whole", 1, range(12), tuple(FILES))
    assert [answer.wrong for answer in found if answer.wrong] == []
    # most of them are wrong, and not all
    ended = Counter(answer.ended.split()[-1] for answer in found)
    assert ended["2"] > 1
    assert ended["0"] > 0
