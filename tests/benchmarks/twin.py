"""How often true inputs lie within the intervals that are identified: a synthetic twin of the bundled dovetail.

    python -m tests.benchmarks.twin [--samples 128] [--result FILE.nc]

The dovetail on mesh 1 at 212.75 Hz wears for 3e5 cycles, with scattered wear coefficient and friction. Of the samples
three quarters identify; each of the others is the truth of some of 100 draws: its worn volumes at four counts, with 8 %
of noise, are what was measured. Wanted: of the draws in which something is identified, 90 % have the truth within its
interval of 90 %, each input by itself. A result that is there is read. 25 CPU minutes.
"""

import tempfile
from pathlib import Path

import numpy as np
import xarray as xr

from studyrunner import run_study
from studyrunner.measured import MeasuredSection
from studyrunner.statistics.identification import TooFewSamplesError, identify
from tests.benchmarks.frame import Table, arguments

COUNTS, NOISE, DRAWS = np.array([2e4, 5e4, 1e5, 1.5e5]), 0.08, 100
INPUTS = ("wear_coefficient", "friction_coefficient")


def study_of(samples: int) -> dict[str, object]:
    """What is changed in the bundled study."""
    scatter = {
        "samples": samples,
        "method": "random",
        "wear_coefficient": {"lognormal": {"factor": 1.3}},
        "friction_coefficient": {"uniform": {"half_width": 0.06}},
    }
    return {
        "scene.mesh": 1,
        "axes.frequency": 212.75,
        "axes.scheme": "adaptive",
        "slow_time.cycles": 3e5,
        "slow_time.outputs": 61,
        "outputs.variables": ["worn_volume", "worn_volume_error"],
        "outputs.loops": [],
        "scatter": scatter,
    }


def coverage(result: xr.Dataset, draws: int = DRAWS) -> xr.Dataset:
    """Of each draw, over `draw` and `input`: low and high end of the interval and the true input; NaN where too few
    samples agree.
    """
    n_own = 3 * result.sizes["sample"] // 4
    own, others = result.isel(sample=slice(n_own)), result.isel(sample=slice(n_own, None))
    volumes = others["worn_volume"].squeeze(drop=True).transpose("sample", "cycle").values
    random, ends = np.random.default_rng(0), np.full((draws, len(INPUTS), 3), np.nan)
    for draw in range(draws):
        place = draw % len(volumes)
        exact = np.interp(COUNTS, result["cycle"].values, volumes[place])
        noisy, deviation = exact * (1.0 + NOISE * random.standard_normal(len(COUNTS))), NOISE * exact
        measured = {"at": COUNTS.tolist(), "value": noisy.tolist(), "standard_deviation": deviation.tolist()}
        section = MeasuredSection.model_validate({"worn_volume": measured}, strict=False)
        try:
            found = identify(own, section)["posterior_quantile"].sel(input=list(INPUTS)).values
        except TooFewSamplesError:
            continue
        ends[draw, :, :2] = found[:, [0, -1]]
        ends[draw, :, 2] = [others[f"sample_{name}"].values[place] for name in INPUTS]
    dims = ("draw", "input")
    return xr.Dataset(
        {name: (dims, ends[..., k]) for k, name in enumerate(("low", "high", "true"))}, {"input": list(INPUTS)}
    )


def main() -> None:
    given = arguments(__doc__, (), samples=128, result=None)
    with tempfile.TemporaryDirectory() as folder:
        path = given.result or Path(folder) / "twin.nc"
        result = run_study("dovetail", path, overrides=study_of(given.samples)).load()
    found = coverage(result)
    identified = found["low"].notnull().all("input")
    known = found.isel(draw=np.flatnonzero(identified))
    inside = ((known["low"] <= known["true"]) & (known["true"] <= known["high"])).mean("draw")
    print(f"{int(identified.sum())} of {DRAWS} draws identified")
    table = Table("input", "within, %", "width, %")
    for name in INPUTS:
        width = float(((known["high"] - known["low"]) / known["true"]).sel(input=name).median())
        table.row(name, 100.0 * float(inside.sel(input=name)), 100.0 * width)


if __name__ == "__main__":
    main()
