"""A picture of the contact surfaces: pairs with their numbers and frames."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from studies.fe_models.fe_scene import FeScene
from studies.fe_models.joint.pairing import ContactPairs

_MOST_NUMBERS = 150
_COLOURS = ("tab:red", "tab:green", "tab:blue")  # normal, first and second tangent


def draw_pairs(scene: FeScene, path: Path) -> None:
    """Writes a PNG with one part for each pair of surfaces. Raises OSError."""
    pairs = scene.pairs
    n = len(pairs.moving_name)
    columns = min(n, 3)
    rows = -(-n // columns)
    figure = Figure(figsize=(7.0 * columns, 6.5 * rows), layout="constrained")
    for place in range(n):
        _draw_surface(figure, (rows, columns, place + 1), pairs, place)
    figure.suptitle("contact pairs: normal (red), first tangent (green), second tangent (blue)")
    figure.savefig(path, format="png")


def _draw_surface(figure: Figure, where: tuple[int, int, int], pairs: ContactPairs, place: int) -> None:
    own = np.flatnonzero(pairs.surface == place)
    position = pairs.position[own]
    axes = figure.add_subplot(*where, projection="3d")
    opposite = position + pairs.distance[own, None] * pairs.frames[own, 0]
    axes.scatter(*opposite.T, s=12, marker="x", color="0.5", label=f"point of {pairs.opposite_name[place]}")
    axes.scatter(*position.T, s=8, color="black", label=f"node of {pairs.moving_name[place]}")
    length = 0.6 * np.sqrt(np.median(pairs.area[own]))
    for direction, colour in enumerate(_COLOURS):
        axes.quiver(*position.T, *pairs.frames[own, direction].T, length=length, color=colour, linewidth=0.8)
    for number in own[:_MOST_NUMBERS]:
        axes.text(*pairs.position[number], str(number), fontsize=7)
    axes.set(xlabel="x, m", ylabel="y, m", zlabel="z, m")
    axes.set_title(f"{pairs.moving_name[place]} on {pairs.opposite_name[place]}: {len(own)} pairs")
    # a cube: one scale for all directions
    middle = (position.min(axis=0) + position.max(axis=0)) / 2.0
    half = 0.5 * np.ptp(position, axis=0).max() + length
    limits = {f"{name}lim": (at - half, at + half) for name, at in zip("xyz", middle, strict=True)}
    axes.set(**limits, box_aspect=(1, 1, 1))
    axes.legend(fontsize=7)
