"""Some fuzzed scene, deck and result files: no traceback and no hang; `fuzz_files` tries thousands."""

from collections import Counter

import pytest

from tests.benchmarks.fuzz_files import answer, write_whole_files


@pytest.mark.slow
@pytest.mark.usefixtures("folder")
def test_fuzzed_files():
    write_whole_files()
    found = [answer(1, number) for number in range(16)]
    assert [each.wrong for each in found if each.wrong] == []
    # most of them are wrong, and not all
    ended = Counter(each.ended.split()[-1] for each in found)
    assert ended["2"] > 1
    assert ended["0"] > 0
