"""Some fuzzed study, scene and result files: no traceback, no hang, at most 1 GB; `fuzz_files` tries thousands."""

from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import pytest

from tests.studyrunner.fuzzed import read_mutations, together, write_whole_files
from tests.studyrunner.fuzzing import KINDS

N_FILES = 50
N_DRAWN = 10
AT_ONCE = 2


@pytest.mark.slow
@pytest.mark.parametrize(("n_files", "kinds"), [(N_FILES, KINDS), (N_DRAWN, {"report": 0.5, "reader": 0.5})])
def test_fuzzed_files(n_files, kinds, tmp_path):
    write_whole_files(tmp_path)
    parts = [range(n_files * part // AT_ONCE, n_files * (part + 1) // AT_ONCE) for part in range(AT_ONCE)]
    with ThreadPoolExecutor(AT_ONCE) as pool:
        found = together(pool.map(lambda part: read_mutations(tmp_path, 1, part, kinds), parts))
    assert found.wrong == ()
    assert found.statuses.total() == n_files
    # most of them are wrong, and not all: those that are would say little otherwise
    ended = Counter(key.split()[-1] for key in found.statuses.elements())
    assert ended["2"] > n_files / 20
    assert ended["0"] > 0
    assert found.largest < 2**30
