"""What a user checks of a finite-element model before it is computed with: lines, and a picture of the pairs."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from scipy.linalg import eigh

from solver import SolverSettings, march_wear
from solver.model import BoolArray, FloatArray, IntArray, LinearModel, ReducedModel
from studies.fe_models.from_files.model import LoadedModel, reduce_model
from studies.finite_element.pairing import ContactPairs
from studies.finite_element.reduced_joint import ABOVE, FeScene
from studies.scene import Progress, make_compliant, silent

N_FREQUENCIES = 8
"""Natural frequencies that are shown of the glued model, and half as many with the pairs sliding."""

_RPM = 30.0 / np.pi
_NEIGHBOURS = {0: "", 1: " of the next sector", -1: " of the sector before"}
_ROUND_OFF = 1e-9  # of the size of a facet, or of the largest force: a distance or a force that is none
_STIFF = 1e-4  # of the last frequency shown: round-off of coordinates and of coefficients in a deck
_FREE = 1e-9  # stiffness over the largest one of the relative displacements, below which nothing holds a motion
_MOST_NUMBERS = 150
_COLOURS = ("tab:red", "tab:green", "tab:blue")  # normal, first and second tangent
_SHADES = ("tab:orange", "0.5")  # of the facets with the moving nodes, and of those opposite
_ASIDE = (1.0, 0.5, 0.4)  # from where a surface is looked at, in its mean frame: neither on edge nor normals on end


def describe_model(loaded: LoadedModel, scene: FeScene, progress: Progress = silent) -> list[tuple[str, str]]:
    """Label and text of each line. scene: the reduced model. Raises SceneError."""
    parameters, joint, coordinates = loaded.parameters, loaded.joint, loaded.model.mesh.coordinates
    prepared = scene.prepared
    free: BoolArray = np.asarray(~prepared.structure.held.all(axis=1))
    if joint.cut is not None:
        free[joint.cut.right] = False
    mass, placed = prepared.weight.sum(), ~np.isnan(coordinates[:, 0])
    rows = [
        ("mass", f"{mass:.6g} kg, {3 * np.count_nonzero(free)} displacements that are not held"),
        ("extent", f"{_vector(np.ptp(coordinates[placed], axis=0))} m; given in {parameters.units}"),
        ("centre", f"{_vector(prepared.weight[placed] @ coordinates[placed] / mass)} m"),
    ]
    rotation, speed = loaded.model.rotation, "none"
    if rotation is not None:
        speed = f"{np.sqrt(rotation.omega_squared) * _RPM:.6g} rpm about {_vector(rotation.axis)}{_held(loaded)}"
    rows.append(("speed", speed))
    if joint.cut is not None:
        n = joint.cut.axis.n_sectors
        rows.append(("sectors", f"{n}, {360.0 / n:.5g} degrees each, {len(joint.cut.left)} nodes on a cut face"))
    rows += [("contact", text) for text in _contacts(scene)]
    rows += [("glued", f"{tie.name} stay glued") for tie in joint.ties]
    rows += [("warning", text) for text in prepared.structure.notes]
    progress("natural frequencies of the glued model")
    k = parameters.nodal_diameter
    n_shown = N_FREQUENCIES + 6 * (parameters.suspension > 0.0)  # motions as one body
    turning = prepared.frequencies(k, n_shown)
    where = f"nodal diameter {k}: " if joint.cut is not None else ""
    glued = f"{where}{_frequencies(turning)} Hz without prestress"
    if loaded.model.forms is not None:
        glued = f"{where}{_frequencies(turning)} Hz, with what the matrices hold"
    elif "elastic" in prepared.forms:
        still = prepared.frequencies(k, n_shown, "elastic")
        glued = f"{where}{_frequencies(still)} Hz at rest, {_frequencies(turning)} Hz with prestress"
    rows.append(("glued", glued))
    first = dict(sorted((k, found[0]) for k, found in scene.glued_frequencies.items()))
    if len(first) > 1:
        listed = ", ".join(map(str, first))
        rows.append(("glued", f"first at nodal diameters {listed}: {_frequencies(np.array([*first.values()]))} Hz"))
    progress("reduction with twice the modes")
    rows.append(("reduction", _reduction_error(loaded, scene)))
    rows += _rigid(loaded, scene, turning[-1])
    total = total_force(loaded, prepared.static_load)
    rows.append(("force", f"{_vector(total)} N in all at rest, {np.linalg.norm(total):.4g} N"))
    progress("state at rest")
    friction = parameters.friction_coefficient
    stiff = make_compliant(scene.model, parameters.contact_stiffness)
    rows.append(("static", describe_rest(stiff, friction if isinstance(friction, float) else None)))
    rows += loaded.deck.remarks
    return rows


def _rigid(loaded: LoadedModel, scene: FeScene, highest: float) -> Iterator[tuple[str, str]]:
    """Motions as one body, and of bodies. highest: of the frequencies that are shown, Hz."""
    resistance, name = scene.prepared.find_resistance(loaded.motions)
    resists = name if resistance > _STIFF * highest else "no constraint"
    free = f"{_count_free_motions(scene.model, open_pairs=True)} motions with all pairs open"
    yield "rigid", f"{free}; {resists} resists a motion of all as one body"
    if resists == name:
        found = f"{name} strains the model where it moves as one body, by the energy of at most {resistance:.3g} Hz"
        yield "warning", f"{found}: join nodes that coincide, or let rotations follow"
    if held := _count_free_motions(scene.model):
        verb = "motion is" if held == 1 else "motions are"
        yield "warning", f"{held} {verb} held by friction alone: give retention_stiffness"


def total_force(loaded: LoadedModel, load: FloatArray) -> FloatArray:
    """Sum (3,) of nodal forces (3 n_nodes,), those on reference nodes included."""
    acting = np.flatnonzero(~np.isnan(loaded.model.mesh.coordinates[:, 0]))
    if loaded.deck.contact_nodes is None:  # reference nodes have no place; their rotations have the same number again
        numbers, first = np.unique(loaded.model.mesh.numbers, return_index=True)
        acting = first[numbers > 0]
    return np.asarray(load.reshape(-1, 3)[acting].sum(axis=0))


def _free(model: ReducedModel, linear: LinearModel) -> IntArray:
    """Displacements that are free where all pairs stay closed and slide freely."""
    closing = model.contact.dofs[:, 0]
    return np.setdiff1d(np.arange(len(linear.stiffness)), closing[closing >= 0])


def _count_free_motions(model: ReducedModel, *, open_pairs: bool = False) -> int:
    """Motions without stiffness where all pairs stay closed and slide freely, or where they are open."""
    linear = model.linear[0]
    free = np.arange(len(linear.stiffness)) if open_pairs else _free(model, linear)
    stiffness = linear.stiffness.real[np.ix_(free, free)]
    # modal coordinates have another unit: each displacement is scaled by its own stiffness
    scale = 1.0 / np.sqrt(np.maximum(np.diag(stiffness), np.finfo(np.float64).tiny))
    return int(np.count_nonzero(np.linalg.eigvalsh(stiffness * scale * scale[:, None]) < _FREE))


def _sliding_frequencies(linear: LinearModel, model: ReducedModel) -> FloatArray:
    """Natural frequencies, Hz, ascending, with all pairs closed and sliding freely; 0 of what nothing holds."""
    free = _free(model, linear)
    stiffness, mass = (part[np.ix_(free, free)] for part in (linear.stiffness, linear.mass))
    # A mass may be singular, and spin softening alone acts on what slides as a whole: M x = (K + s M) x / (w^2 + s),
    # s from the lowest glued mode, the first of those behind the relative displacements.
    shift = float(np.diag(linear.stiffness)[np.count_nonzero(model.contact.dofs >= 0)].real)
    inverse = eigh(mass, stiffness + shift * mass, eigvals_only=True)[::-1]
    return np.asarray(np.sqrt(np.maximum(1.0 / inverse[inverse > 0.0] - shift, 0.0)) / (2.0 * np.pi))


def _reduction_error(loaded: LoadedModel, scene: FeScene) -> str:
    """How far frequencies change with twice the modes, where the pairs slide freely and the joint moves most."""
    parameters, model = loaded.parameters, scene.model
    k = parameters.nodal_diameter
    n_modes = len(model.linear[k].stiffness) - np.count_nonzero(model.contact.dofs >= 0)
    if n_modes < parameters.stuck_modes:
        return f"none: there are no more than {n_modes} modes with the pairs glued"
    more = parameters.model_copy(update={"stuck_modes": 2 * parameters.stuck_modes})
    finer = reduce_model(replace(loaded, parameters=more), 1, prepared=scene.prepared).model
    own, other = (_sliding_frequencies(each.linear[k], each) for each in (model, finer))
    own, other = (each[each > ABOVE * parameters.suspension][:N_FREQUENCIES] for each in (own, other))
    n = min(len(own), len(other))
    elastic = other[:n] > 1e-3 * other[:n].max()
    own, other = (each[:n][elastic][: N_FREQUENCIES // 2] for each in (own, other))
    worst = np.abs(own / other - 1.0).max()
    sliding = f"with the pairs sliding freely {_frequencies(own)} Hz, by at most {100.0 * worst:.2g} % off those with"
    return f"{parameters.stuck_modes} modes; {sliding} {more.stuck_modes}"


def _contacts(scene: FeScene) -> Iterator[str]:
    pairs = scene.prepared.pairs
    for place, (moving, opposite) in enumerate(zip(pairs.moving_name, pairs.opposite_name, strict=True)):
        own = pairs.surface == place
        neighbour = _NEIGHBOURS[int(pairs.sector[own][0])] if own.any() else ""
        distance = pairs.distance[own]
        distance = np.where(np.abs(distance) < _ROUND_OFF * np.sqrt(pairs.area[own].max()), 0.0, distance)
        nodes = "node" if own.sum() == 1 else "nodes"
        covered = f"{own.sum()} {nodes} of {moving} on {opposite}{neighbour}, {1e6 * pairs.area[own].sum():.5g} mm2"
        yield f"{covered}, distances {distance.min():.2g} to {distance.max():.2g} m"


def describe_rest(model: ReducedModel, friction_coefficient: float | None) -> str:
    """Normal forces of the state at rest: that from which a run begins, with friction, gaps and interference.

    friction_coefficient: None where the model has its own.
    """
    contact = model.contact
    glued = model.linear[0].load_static[contact.dofs[contact.dofs[:, 0] >= 0, 0]]
    if not model.linear[0].load_static.any() and (contact.gap >= -_ROUND_OFF * np.sqrt(contact.area)).all():
        return "no static load and no interference: nothing presses the surfaces together"
    one = SolverSettings(harmonics=1)
    # without excitation: any frequency has the same state
    found = march_wear(
        model, 1.0, 0.0, friction_coefficient, 0.0, 0.0, scheme="explicit", step=1.0, sweep="ramp", settings=one
    )
    if not found.outcome.complete:
        return f"{found.outcome.sentence} Normal forces of the glued pairs: sum {_sum(glued)} N"
    forces = found.mean_pressure[0] * contact.area
    pressed = forces > _ROUND_OFF * np.abs(model.linear[0].load_static).max(initial=forces.max())
    if not pressed.any():
        return "at rest no pair carries a force: the joint opens, give a preload"
    closed = f"{pressed.sum()} of {len(forces)} pairs" if len(forces) > 1 else "the pair"
    return f"normal forces at rest: sum {_sum(forces)} N, {closed} closed"


def _sum(forces: FloatArray) -> str:
    """Sum of forces, N; 0 where it is round-off of the single ones."""
    total = float(forces.sum())
    return f"{total if abs(total) > _ROUND_OFF * np.abs(forces).sum() else 0.0:.4g}"


def _held(loaded: LoadedModel) -> str:
    if loaded.model.forms is None:
        return ""
    if loaded.omega_squared_held is None:
        return "; the matrices do not tell theirs"
    return f"; the stiffness holds {np.sqrt(loaded.omega_squared_held) * _RPM:.6g} rpm"


def _vector(values: FloatArray) -> str:
    return "(" + ", ".join(f"{value:.4g}" for value in np.where(np.abs(values) < 1e-12, 0.0, values)) + ")"


def _frequencies(values: FloatArray) -> str:
    return ", ".join(f"{value:.2f}" for value in values)


def draw_pairs(loaded: LoadedModel, scene: FeScene, path: Path) -> None:
    """Writes a PNG with one part for each pair of surfaces. Raises OSError."""
    n = len(scene.prepared.pairs.moving_name)
    rows, columns = -(-n // 3), min(n, 3)
    figure = Figure(figsize=(7.0 * columns, 6.5 * rows), layout="constrained")
    for place in range(n):
        _draw_surface(figure, (rows, columns, place + 1), loaded, scene.prepared.pairs, place)
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
        facets = loaded.model.mesh.coordinates[both[name].facets]
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
    for name in "xyz":
        # beside the numbers of the ticks
        getattr(axes, f"set_{name}label")(f"{name}, m", labelpad=9.0)
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
