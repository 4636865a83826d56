"""The Fourier basis against its definition."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver.structure.fourier import build_basis, change_orders, derivative, from_complex, to_complex

OMEGA = 37.0


def test_synthesis_is_the_series_0_cos_1_sin_1_cos_2_sin_2():
    time = np.arange(32) / 32 * 2 * np.pi / OMEGA
    expected = 0.3 + 1.1 * np.cos(OMEGA * time) - 0.4 * np.sin(OMEGA * time) + 2.5 * np.sin(2 * OMEGA * time)
    assert np.array([0.3, 1.1, -0.4, 0.0, 2.5]) @ build_basis((1, 2), 32).synthesis == pytest.approx(
        expected, abs=1e-14
    )


def test_a_complex_amplitude_is_the_real_part_of_a_rotation_forwards():
    amplitudes = np.array([[0.7 - 0.2j, 1.5j], [-2.0, 0.1 + 0.4j]])
    static = np.array([0.5, -1.0])
    phase = 2 * np.pi * np.arange(16) / 16
    expected = static[:, None] + sum(np.real(amplitudes[:, n - 1, None] * np.exp(1j * n * phase)) for n in (1, 2))
    values_h = from_complex(static, amplitudes)
    assert values_h @ build_basis((1, 2), 16).synthesis == pytest.approx(expected, abs=1e-14)
    assert np.array_equal(to_complex(values_h), amplitudes)
    assert np.array_equal(values_h[:, 0], static)


def test_derivative_multiplies_the_amplitude_of_harmonic_n_by_i_n_omega():
    values_h = np.random.default_rng(1).normal(size=(2, 3, 9))
    rate_h = derivative(values_h, OMEGA * np.arange(1, 5))
    assert to_complex(rate_h) == pytest.approx(1j * OMEGA * np.arange(1, 5) * to_complex(values_h), abs=1e-12)
    assert not rate_h[..., 0].any()


@pytest.mark.parametrize(("orders", "samples"), [((1,), 2), ((1, 2, 3), 6), ((1, 3, 5), 10), ((7,), 4), ((), 0)])
def test_samples_that_alias_are_refused(orders, samples):
    with pytest.raises(ValueError, match="samples"):
        build_basis(orders, samples)


@given(orders=st.sets(st.integers(1, 30), max_size=8), extra=st.integers(1, 20), seed=st.integers(0, 2**31))
def test_analysis_undoes_synthesis_for_any_orders(orders, extra, seed):
    ascending = tuple(sorted(orders))
    basis = build_basis(ascending, 2 * max(ascending, default=0) + extra)
    assert basis.n_harmonics == len(orders)
    values_h = np.random.default_rng(seed).normal(size=(3, 2 * len(orders) + 1))
    assert values_h @ basis.synthesis @ basis.analysis == pytest.approx(values_h, abs=1e-13)


@pytest.mark.parametrize(
    ("orders", "wanted"),
    [
        ((1, 2), (1, 2, 3, 4)),
        ((1, 2, 3, 4), (1,)),
        ((1, 2, 3, 4, 5), (1, 3, 5)),
        ((1, 3, 5), (1, 2, 3, 4, 5)),
        ((1, 3, 5), (1, 2, 5, 8)),
        ((), (1, 3)),
        ((1, 3), ()),
    ],
)
def test_changed_orders_keep_the_harmonics_that_both_have(orders, wanted):
    values_h = np.random.default_rng(3).normal(size=(2, 3, 2 * len(orders) + 1))
    changed = change_orders(values_h, orders, wanted)
    assert changed.shape == (2, 3, 2 * len(wanted) + 1)
    assert np.array_equal(changed[..., 0], values_h[..., 0])
    before, after = to_complex(values_h), to_complex(changed)
    for place, order in enumerate(wanted):
        if order in orders:
            assert np.array_equal(after[..., place], before[..., orders.index(order)])
        else:
            assert not after[..., place].any()
