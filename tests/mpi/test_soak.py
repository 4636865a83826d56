"""How tests and soak tell what was lost with a run that was killed."""

import time
from collections import Counter
from pathlib import Path

import pytest

from tests.mpi.losses import DONE, find_losses, note_end, note_kill


def test_what_is_finished_again_after_a_kill_was_lost_with_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for when, note in ((120.0, note_kill), (121.0, note_end), (130.0, note_kill), (130.5, note_end), (140.0, note_end)):
        monkeypatch.setattr(time, "time", lambda when=when: when)
        note(tmp_path)
    done = [
        *("101 step a 0", "108 step a 1", "116 step a 2", "121.5 step a 2", "131 step a 3"),
        *("109 result a 0", "109.5 result b 0", "126 result b 0", "117.0 result c 0", "131.0 result c 0"),
        # the first by a rank that has outlived the kill
        *("120.9 result d 0", "122 result d 0", "120.5 result e 0", "131 result e 0"),
    ]
    (tmp_path / DONE).write_text("\n".join(done), encoding="ascii")
    losses = find_losses(tmp_path)
    # before the first kill steps 0 and 1 and results a and b, before the second one step 2 and result d
    assert losses.at_risk == Counter(step=3, result=3)
    assert losses.broken == Counter(result=1)
    assert losses.oldest == {"step": 4.0, "result": 10.5}
    assert str(losses).splitlines()[0].startswith("1 of 3 results finished more than 5 s before a kill were lost; ")
