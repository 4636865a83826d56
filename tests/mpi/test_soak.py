"""A few of the random kills of the soak."""

from __future__ import annotations

from pathlib import Path

from tests.benchmarks.soak import soak


def test_a_few_random_kills_lose_nothing(tmp_path: Path) -> None:
    same, n_kills, wrong = soak(8, 1000, tmp_path)
    assert wrong == []
    assert same == 8
    assert n_kills >= 8
