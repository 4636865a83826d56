"""[scatter]: its sentences, the designs, and the values that samples draw."""

import re

import numpy as np
import pytest
from scipy.stats import kstest, sobol_indices

from studyrunner.scatter import ScatteredPairs, ScatterSection, drawn, flat_table, unit_design
from studyrunner.user_error import WrongValueError

FRICTION = {"normal": {"mean": 0.5, "std": 0.03}}
ANY_INPUT = {"friction_coefficient": FRICTION}
PAIRS = ScatteredPairs(("left",) * 3 + ("right",) * 2, np.linspace(0.0, 1.0, 15).reshape(5, 3))
OWN = {"friction_coefficient": 0.3, "gap": np.linspace(0.0, 4e-6, 5), "wear_coefficient": 1.1e-11, "area": 0.1 + 0.2}


def read(**table):
    return ScatterSection.model_validate(flat_table({"samples": 64, **table}))


def draw(pairs=PAIRS, **table):
    return drawn(read(**table), OWN, pairs)


# --- the table ---


def test_defaults_and_what_is_written_back():
    section = read(**ANY_INPUT)
    assert (section.samples, section.method, section.seed, section.realisations) == (64, "sobol", 1, 64)
    assert section.model_dump(mode="json", exclude_none=True) == {
        "samples": 64,
        "method": "sobol",
        "seed": 1,
        "friction_coefficient": {**FRICTION, "of": "all pairs"},
    }


# --- the designs ---


@pytest.mark.parametrize("method", ["sobol", "latin_hypercube", "random", "saltelli"])
def test_designs_fill_the_cube_and_further_columns_change_none(method):
    design = unit_design(method, 3, 256, 4)
    assert ((design > 0.0) & (design < 1.0)).all()
    assert [kstest(column, "uniform").pvalue > 1e-3 for column in design.T] == [True] * 4
    assert np.abs(np.corrcoef(design.T) - np.eye(4)).max() < (0.2 if method == "random" else 0.1)
    if method != "saltelli":
        np.testing.assert_array_equal(unit_design(method, 3, 256, 9)[:, :4], design)
        assert not np.array_equal(unit_design(method, 4, 256, 4), design)


def test_a_scrambled_sobol_sequence_is_a_digital_net():
    """128 points, of the first two columns: one in each cell of 2^-k times 2^-(7-k), as without scrambling."""
    design = unit_design("sobol", 7, 128, 2)
    for power in range(8):
        cells = np.floor(design * [2**power, 2 ** (7 - power)])
        assert len(np.unique(cells, axis=0)) == 128


def test_rows_of_saltelli_are_those_of_scipy():
    """Indices of a linear function of three groups of columns; the second group has two columns."""
    design = unit_design("saltelli", 1, 1024, 4, (1, 2, 1))
    f_A, f_B, *f_AB = (design @ [1.0, 2.0, 2.0, 4.0]).reshape(1024, 5).T
    found = sobol_indices(func={"f_A": f_A[None], "f_B": f_B[None], "f_AB": np.array(f_AB)[:, None]}, n=1024)
    np.testing.assert_allclose(found.first_order, np.array([1.0, 8.0, 16.0]) / 25.0, atol=0.03)
    np.testing.assert_allclose(found.total_order, np.array([1.0, 8.0, 16.0]) / 25.0, atol=0.03)


# --- the drawn values ---


def test_each_distribution_has_its_quantiles():
    section = {
        "absolute": {"lognormal": {"median": 2.0, "factor": 1.5}},
        "area": {"normal": {"relative_std": 0.1}},
        "gap": {"uniform": {"half_width": 1e-6}},
        "range": {"uniform": {"low": 3.0, "high": 5.0}},
        "wear_coefficient": {"lognormal": {"factor": 1.5}},
    }
    found = draw(samples=4096, **section)
    assert [name for name, one in found.items() if one.distribution.is_absolute] == ["absolute", "range"]
    share = 0.8413447460685429  # one standard deviation above the median
    expected = {"absolute": 3.0, "area": 1.1, "gap": 1.0 + 1e-6 * (2 * share - 1), "range": 3 + 2 * share}
    for name, value in {**expected, "wear_coefficient": 1.5}.items():
        assert np.quantile(found[name].apply(1.0), share) == pytest.approx(value, rel=2e-3)


@pytest.mark.parametrize("of", ["all pairs", "each surface", "each pair"])
@pytest.mark.parametrize(
    "distribution", [{"normal": {"std": 0}}, {"lognormal": {"factor": 1}}, {"uniform": {"half_width": 0}}]
)
def test_zero_width_is_the_own_value_to_the_last_bit(of, distribution):
    (found,) = draw(area={**distribution, "of": of}).values()
    own = 0.1 + 0.2 * np.arange(5.0)
    assert (found.apply(own) == own).all()
    assert (found.apply(0.1 + 0.2) == 0.1 + 0.2).all()


def test_draws_of_one_input_do_not_depend_on_the_pairs_of_another():
    gap = {"normal": {"std": 1e-6}, "of": "each pair"}
    alone = draw(**ANY_INPUT)["friction_coefficient"]
    beside = draw(**ANY_INPUT, gap=gap)
    np.testing.assert_array_equal(beside["friction_coefficient"].score, alone.score)
    assert beside["gap"].apply(OWN["gap"]).shape == (64, 5)


def test_each_surface_has_a_draw():
    found = draw(friction_coefficient={**FRICTION, "of": "each surface"})["friction_coefficient"]
    values = found.apply(0.3)
    assert values.shape == (64, 5)
    assert [len(np.unique(row)) for row in values] == [2] * 64
    assert (values[:, 0] == values[:, 2]).all()


def test_neighbouring_pairs_are_correlated_over_the_length():
    along = np.outer(np.repeat([0.0, 1.0, 3.0], 2), [1.0, 0.0, 0.0])
    pairs = ScatteredPairs(("left", "right") * 3, along)
    gap = {"normal": {"std": 2.0}, "of": "each pair", "correlation_length": 1.0}
    values = drawn(read(gap=gap, samples=4096), {"gap": 0.0}, pairs)["gap"].apply(0.0)
    expected = np.where(
        np.arange(6)[:, None] % 2 == np.arange(6) % 2, np.exp(-0.5 * (along[:, :1] - along[:, 0]) ** 2), 0
    )
    np.testing.assert_allclose(np.corrcoef(values.T), expected, atol=0.03)
    np.testing.assert_allclose(values.std(axis=0), 2.0, rtol=0.02)


def test_a_correlation_length_needs_positions():
    pairs = ScatteredPairs(PAIRS.surface, np.full((5, 3), np.nan))
    gap = {"normal": {"std": 1e-6}, "of": "each pair", "correlation_length": 1e-3}
    with pytest.raises(WrongValueError, match="where its contact pairs are") as caught:
        draw(pairs, gap=gap)
    assert caught.value.key == "scatter.gap.correlation_length"


@pytest.mark.parametrize(
    ("name", "distribution"),
    [
        ("friction_coefficient", {"normal": {"std": 0.3}}),
        ("wear_coefficient", {"normal": {"relative_std": 1.0}}),
        ("area", {"uniform": {"low": -1e-3, "high": 1.0}}),
        ("frequency", {"uniform": {"low": -1.0, "high": 1.0}}),
        ("excitation_amplitude", {"normal": {"mean": 1.0, "std": 1.0}}),
    ],
)
def test_draws_that_physics_forbids_are_refused(name, distribution):
    with pytest.raises(WrongValueError, match=re.escape(f"which {name} cannot be")) as caught:
        draw(**{name: distribution}, samples=10_000)
    assert caught.value.key == f"scatter.{name}"


def test_each_value_of_an_axis_is_looked_at_and_a_share_of_nothing_is_refused():
    section = read(friction_coefficient={"uniform": {"half_width": 0.2}})
    assert drawn(section, {"friction_coefficient": [[0.3], [0.4]]}, PAIRS)
    with pytest.raises(WrongValueError, match="less width"):
        drawn(section, {"friction_coefficient": [[0.3], [0.1]]}, PAIRS)
    with pytest.raises(WrongValueError, match="own value is 0"):
        drawn(read(gap={"normal": {"relative_std": 0.1}}), {"gap": np.zeros(5)}, PAIRS)
