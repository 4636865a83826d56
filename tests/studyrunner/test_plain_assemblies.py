"""Assemblies without cyclic symmetry, from a deck to a worn volume; static forces by equilibrium and closed forms."""

import numpy as np
import pytest
import xarray as xr

from studies.finite_element.element_matrices import Material
from studyrunner.cli import main
from tests.studies.fe_models.sectors import faces_where
from tests.studies.fe_models.solid_meshes import block, deck_lines, joined, node_set

MM_STEEL = Material(210e3, 0.3, 7.8e-9)  # MPa, t/mm3

CYLINDER = """
[study]
name = "cylinder"
[scene]
model = "cylinder.inp"
units = "mm-t-s"
contact = [["ROUND", "FLAT"]]
gaps = true
tolerance = 1e-4
friction_coefficient = 0.1
load = {set = "TOP", direction = [1, 0, 0]}
preload = [{set = "TOP", direction = [0, 0, -1], force = 363.0}]
[axes]
frequency = 50.0
wear_coefficient = 1e-11
excitation_amplitude = 20.0
[slow_time]
cycles = 1e4
outputs = 2
[solver]
harmonics = "auto"
samples = "auto"
rtol = 5e-2
"""

NEXT_TO_NOTHING = ("axes.excitation_amplitude=1e-3", "slow_time.cycles=0", "slow_time.outputs=1")


def face_set(mesh, name, inside):
    return [f"*SURFACE, NAME={name}", *(f"{e}, S{f}" for e, f in zip(*faces_where(mesh, inside), strict=True))]


def cylinder_deck(radius=10.0, n=16):
    """The lowest part of a cylinder on a block, in plane strain: one layer of elements that is held along the axis."""

    def toothed(points):
        """Finer towards the middle, and towards the contact at the height 0."""
        x = 2.0 * points[:, 0] - 1.0
        return 0.4 * x + 0.6 * x**3, 0.25 * points[:, 1], points[:, 2] ** 1.5

    def round_part(points):
        x, y, height = toothed(points)
        low = radius - np.sqrt(radius**2 - x**2)
        return np.stack([x, y, low + (2.0 - low) * height], axis=1)

    def flat_part(points):
        x, y, depth = toothed(points * [1.0, 1.0, -1.0] + [0.0, 0.0, 1.0])
        return np.stack([x, y, -2.0 * depth], axis=1)

    upper, _ = block("C3D8I", (n, 1, 8), round_part, MM_STEEL)
    lower, _ = block("C3D8I", (n, 1, 8), flat_part, MM_STEEL)
    mesh = joined(upper, lower)
    x, _, z = mesh.coordinates.T
    of_upper = np.arange(mesh.n_nodes) < upper.n_nodes
    touching = np.abs(z - np.where(of_upper, radius - np.sqrt(radius**2 - x**2), 0.0)) < 1e-6
    lines = deck_lines(mesh)
    for name, inside in (("BOTTOM", z < -2.0 + 1e-6), ("TOP", z > 2.0 - 1e-6)):
        lines += node_set(name, mesh.numbers[inside])
    lines += [*face_set(mesh, "ROUND", of_upper & touching), *face_set(mesh, "FLAT", ~of_upper & touching)]
    return "\n".join([*lines, "*BOUNDARY", "BOTTOM, 1, 3", "NALL, 2, 2"]) + "\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cylinder.toml").write_text(CYLINDER)
    (tmp_path / "cylinder.inp").write_text(cylinder_deck())
    return tmp_path


def run(name, *overrides):
    words = [word for each in overrides for word in ("--set", each)]
    assert main([f"{name}.toml", *words, "-o", f"{name}.nc"]) == 0
    with xr.open_dataset(f"{name}.nc") as result:
        return result.load().squeeze()


@pytest.mark.slow
def test_cylinder_on_a_flat(folder):
    result = run("cylinder", *NEXT_TO_NOTHING)
    pressure, x = result.mean_pressure.values, result.contact_x.values
    assert (pressure * result.contact_area.values).sum() == pytest.approx(363.0, rel=1e-6)
    # Hertz, plane strain: p = p_0 sqrt(1 - x^2 / a^2)
    load, modulus = 363.0 / 0.25e-3, 210e9 / (2.0 * (1.0 - 0.3**2))
    half_width = np.sqrt(4.0 * load * 0.01 / (np.pi * modulus))
    hertz = 2.0 * load / (np.pi * half_width) * np.sqrt(np.maximum(1.0 - (x / half_width) ** 2, 0.0))
    assert np.abs(pressure - hertz).max() < 0.06 * hertz.max()
    assert (pressure[np.abs(x) > 0.5e-3] == 0.0).all()
    # in partial slip the middle sticks and does not wear, the edges do
    worn = run("cylinder")
    wear = worn.wear_depth.isel(cycle=-1).values
    assert wear[np.abs(x) < 0.1e-3].max() < 1e-6 * wear.max()
    assert wear[(np.abs(x) > 0.35e-3) & (np.abs(x) < 0.5e-3)].min() > 0.1 * wear.max()
    assert worn.worn_volume.values[-1] > 0.0
    assert worn.outcome == 0
    assert worn.error_estimate < 0.05
