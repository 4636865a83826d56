"""How many harmonics a joint may have."""

from solver.accuracy.harmonic_levels import MOST_UNKNOWNS, n_unknowns, room_for
from solver.settings import Resolution, all_orders


def test_a_large_joint_may_have_as_many_harmonics_as_that_of_48_pairs():
    ours = n_unknowns(Resolution(all_orders(27), 128), 144)
    assert ours <= MOST_UNKNOWNS
    for n_pairs in (1, 48, 160, 2000):
        most = room_for(MOST_UNKNOWNS, 3 * n_pairs)
        assert n_unknowns(Resolution(all_orders(27), 128), 3 * n_pairs) <= most
    # a small one may have more
    assert room_for(MOST_UNKNOWNS, 3) == MOST_UNKNOWNS
