"""How many harmonics a joint may have."""

from solver.accuracy.harmonic_levels import n_unknowns, room_for
from solver.accuracy.options import ACCURACY
from solver.settings import Resolution, all_orders


def test_a_large_joint_may_have_as_many_harmonics_as_that_of_48_pairs():
    ours = n_unknowns(Resolution(all_orders(27), 128), 144)
    assert ours <= ACCURACY.most_unknowns
    for n_pairs in (1, 48, 160, 2000):
        most = room_for(ACCURACY.most_unknowns, 3 * n_pairs)
        assert n_unknowns(Resolution(all_orders(27), 128), 3 * n_pairs) <= most
    # a small one may have more
    assert room_for(ACCURACY.most_unknowns, 3) == ACCURACY.most_unknowns
