"""Rank 0 keeps no results in memory. What a point costs beyond its computing, `tests.benchmarks.overhead` measures."""

from tests.benchmarks.overhead import run


def test_rank_0_does_not_hold_results(tmp_path):
    """Eight times as much in each result takes hardly more memory."""
    outputs, n_points = 16_001, 200
    # both have the slab of 16 MB and the cache of the netCDF library
    small, large = (run(0, n_points, tmp_path, f"{n}.nc", n) for n in (2_001, outputs))
    size = n_points * outputs * 10 * 8 / 2**20
    assert large.memory - small.memory < 60.0 < 0.3 * size
