"""A picture of the contact surfaces: their facets, and the pairs with their numbers and frames."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from studies.fe_models.from_files.model import LoadedModel
from studies.finite_element.pairing import ContactPairs
from studies.finite_element.reduced_joint import FeScene

_MOST_NUMBERS = 150
_COLOURS = ("tab:red", "tab:green", "tab:blue")  # normal, first and second tangent
_SHADES = ("tab:orange", "0.5")  # of the facets with the moving nodes, and of those opposite
_ASIDE = (1.0, 0.5, 0.4)  # from where a surface is looked at, in its mean frame: neither on edge nor normals on end


def draw_pairs(loaded: LoadedModel, scene: FeScene, path: Path) -> None:
    """Writes a PNG with one part for each pair of surfaces. Raises OSError."""
    n = len(scene.pairs.moving_name)
    rows, columns = -(-n // 3), min(n, 3)
    figure = Figure(figsize=(7.0 * columns, 6.5 * rows), layout="constrained")
    for place in range(n):
        _draw_surface(figure, (rows, columns, place + 1), loaded, scene.pairs, place)
    figure.suptitle("contact pairs: normal (red), first tangent (green), second tangent (blue)")
    figure.savefig(path, format="png")


def _draw_surface(
    figure: Figure, where: tuple[int, int, int], loaded: LoadedModel, pairs: ContactPairs, place: int
) -> None:
    own = np.flatnonzero(pairs.surface == place)
    position = pairs.position[own]
    axes = figure.add_subplot(*where, projection="3d", computed_zorder=False)
    contact = loaded.joint.contacts[place]
    moving, opposite = pairs.moving_name[place], pairs.opposite_name[place]
    both = {each.name: each for each in (contact.first, contact.second)}
    for name, colour in zip((opposite, moving), _SHADES[::-1], strict=True):
        facets = loaded.mesh.coordinates[both[name].facets]
        drawn = Poly3DCollection(facets, facecolors=colour, edgecolors=colour, alpha=0.15, label=f"facets of {name}")
        axes.add_collection3d(drawn)
    points = position + pairs.distance[own, None] * pairs.frames[own, 0]
    axes.scatter(*points.T, s=12, marker="x", color="0.5", label=f"point of {opposite}")
    axes.scatter(*position.T, s=8, color="black", label=f"node of {moving}")
    length = 0.6 * np.sqrt(np.median(pairs.area[own]))
    for direction, colour in enumerate(_COLOURS):
        axes.quiver(*position.T, *pairs.frames[own, direction].T, length=length, color=colour, linewidth=0.8)
    for number in own[:_MOST_NUMBERS]:
        axes.text(*pairs.position[number], str(number), fontsize=7)
    axes.set(xlabel="x, m", ylabel="y, m", zlabel="z, m")
    axes.set_title(f"{moving} on {opposite}: {len(own)} pairs")
    # a cube: one scale for all directions
    middle = (position.min(axis=0) + position.max(axis=0)) / 2.0
    half = 0.5 * np.ptp(position, axis=0).max() + length
    limits = {f"{name}lim": (at - half, at + half) for name, at in zip("xyz", middle, strict=True)}
    axes.set(**limits, box_aspect=(1, 1, 1))
    aside = _ASIDE @ np.average(pairs.frames[own], axis=0, weights=pairs.area[own])
    if np.linalg.norm(aside) > 0.1:  # a closed surface has no mean normal
        x, y, z = aside / np.linalg.norm(aside)
        axes.view_init(elev=np.degrees(np.arcsin(z)), azim=np.degrees(np.arctan2(y, x)))
    axes.legend(fontsize=7, loc="upper right")
