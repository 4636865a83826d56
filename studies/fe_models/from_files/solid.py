"""The mesh of a deck in SI units, each element with its material; its rotation and its axis; what units it can have."""

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from solver.model import IntArray
from studies.fe_models.deck.contents import Deck
from studies.fe_models.files import Units
from studies.fe_models.from_files.parameters import MaterialTable, Parameters
from studies.finite_element.cut_faces import CyclicAxis
from studies.finite_element.elements import ASSEMBLED_KINDS, ELEMENT_KINDS
from studies.finite_element.solid_mesh import ElementGroup, Material, Rotation, SolidMesh
from studies.scene_error import SceneError

SPEED_AGREES = 1e-3
"""Relative difference of two speeds that are the same."""

_LEAST_DENSITY, _LARGEST_DENSITY = 1e-2, 3e4
"""kg/m3 over the box around a model: from a blade thin and oblique in its box to solid metal."""

_SOFTEST, _STIFFEST = 5e5, 2e12
"""Young's moduli, Pa, from rubber to diamond. One of several materials may be stiffer, to stand for what is rigid."""

_NOTHING = Material(0.0, 0.0, 0.0)  # of a mesh whose matrices come from elsewhere


def build_solid_mesh(deck: Deck, parameters: Parameters, units: Units) -> SolidMesh:
    """Elements of a deck and their nodes, m; nodes of no element are left out, but of a table of nodes.

    Materials are those of the study, else of the deck; none are needed where the study names matrices. Raises
    SceneError where the deck has no elements, or some have no material.
    """
    if deck.contact_nodes is not None:
        return SolidMesh(deck.coordinates * units.length, deck.node_numbers, ())
    if not deck.blocks:
        raise SceneError("model", f"{deck.path} has no solid elements", "give a deck with the mesh")
    read_as = _read_as(deck, parameters)
    numbers = np.unique(np.concatenate([block.nodes.ravel() for block in deck.blocks]))
    coordinates = deck.coordinates[deck.rows_of_nodes(numbers)] * units.length
    materials = list(_materials(deck, parameters, units))
    groups = []
    for block in deck.blocks:
        left = np.ones(len(block.numbers), dtype=np.bool_)
        # the last section of an element holds
        for name, elements, material in reversed(materials):
            own = left & np.isin(block.numbers, elements)
            if own.any():
                nodes = np.searchsorted(numbers, block.nodes[own]).astype(np.int64)
                kind = read_as.get(block.kind, block.kind)
                groups.append(ElementGroup(kind, nodes, block.numbers[own], material, name))
            left &= ~own
        if left.any():
            found = f"{np.count_nonzero(left)} elements of {deck.path} have none, as element {block.numbers[left][0]}"
            remedy = "give *SOLID SECTION with *ELASTIC and *DENSITY in the deck, or `material` in the study"
            raise SceneError("material", found, remedy)
    return SolidMesh(coordinates, numbers, tuple(groups))


def _read_as(deck: Deck, parameters: Parameters) -> dict[str, str]:
    """Kinds of elements in place of those of the deck. Raises SceneError where they have other nodes."""
    found, own = dict[str, str](), {block.kind for block in deck.blocks}
    for name, given in (parameters.read_as or {}).items():
        kind, other = name.strip().upper(), given.strip().upper()
        if kind not in own:
            raise SceneError("read_as", f"{deck.path} has no element {kind}", f"give one of {', '.join(sorted(own))}")
        nodes = len(ELEMENT_KINDS[kind].reference.corners) + len(ELEMENT_KINDS[kind].reference.edges)
        alike = [each for each in ASSEMBLED_KINDS if ELEMENT_KINDS[each].reference is ELEMENT_KINDS[kind].reference]
        if other not in alike:
            remedy = f"give one with the same {nodes} nodes: {', '.join(alike)}"
            raise SceneError("read_as", f"{kind} is not read as {other}", remedy)
        found[kind] = other
    return found


def _materials(deck: Deck, parameters: Parameters, units: Units) -> Iterator[tuple[str, IntArray, Material]]:
    """Label, element numbers and material; where an element has several the last one holds."""
    given, whole = parameters.material, None
    if isinstance(given, MaterialTable):
        whole = Material(**given.model_dump())
    elif parameters.matrices is not None:
        whole = _NOTHING
    if whole is not None:
        yield "", np.concatenate([block.numbers for block in deck.blocks]), whole
    for section in deck.sections:
        found = deck.materials[section.material]
        if whole is not None:
            yield section.name, section.elements, whole
        elif found.young is not None and found.poisson is not None and found.density is not None and not found.problem:
            values = found.young * units.stress, found.poisson, found.density * units.density
            yield section.name, section.elements, Material(*values)
        elif not isinstance(given, dict):
            what = found.problem or f"{section.material} in {deck.path} is not complete"
            raise SceneError("material", what, "give one isotropic law and a density there, or `material` in the study")
    for name, table in given.items() if isinstance(given, dict) else ():
        elements = deck.element_sets.get(name.strip().upper(), np.empty(0, dtype=np.int64))
        if elements.size == 0:
            known = ", ".join(sorted(deck.element_sets)[:6]) or "none"
            raise SceneError("material", f'no set of elements is named "{name}" in {deck.path}', f"give one of {known}")
        yield name.strip().upper(), elements, Material(**table.model_dump())


def find_axes(deck: Deck, parameters: Parameters, units: Units) -> tuple[Rotation | None, CyclicAxis | None]:
    """Rotation and cyclic symmetry, SI, that the study gives, else the deck; None where there is none.

    Raises SceneError where a speed or a number of sectors has no axis, or parts of the deck turn differently.
    """
    speed, given, n_sectors = parameters.rotation_speed, parameters.axis, parameters.n_sectors
    own = None if speed is not None and given is not None else rotation_of_deck(deck, units)
    of_study = of_sector = rotation = None
    if given is not None:
        of_study = np.array(given.point), np.array(given.direction) / np.linalg.norm(given.direction)
    if deck.cyclic is not None:
        n_sectors = n_sectors or deck.cyclic[0]
        start, end = deck.cyclic[1] * units.length
        of_sector = start, (end - start) / np.linalg.norm(end - start)
    missing = SceneError("axis", "missing", "give {point, direction} of the axis: the deck has none")
    if speed or (speed is None and own is not None):
        axis = of_study or (None if own is None else (own.point, own.axis)) or of_sector
        if axis is None:
            raise missing
        rotation = Rotation(own.omega_squared if speed is None and own else (np.pi * (speed or 0.0) / 30.0) ** 2, *axis)
    if n_sectors is None:
        for key in ("cut_faces", "next_sector"):
            if getattr(parameters, key):
                raise SceneError("n_sectors", "missing", f"give the number of sectors with {key}")
        return rotation, None
    axis = of_study or of_sector or (None if rotation is None else (rotation.point, rotation.axis))
    if axis is None:
        raise missing
    return rotation, CyclicAxis(n_sectors, *axis)


def rotation_of_deck(deck: Deck, units: Units) -> Rotation | None:
    """The rotation, SI, of the centrifugal loads, None of none. Raises SceneError where parts turn differently."""
    if not (loads := deck.centrifugal):
        return None
    for one, other in pairwise(loads):
        same = math.isclose(one.omega_squared, other.omega_squared, rel_tol=SPEED_AGREES)
        if not same or abs(one.axis @ other.axis) < 1 - 1e-9:
            found = f"{other.place} turns otherwise than {one.place}"
            raise SceneError("model", found, "give all of the model one speed and one axis")
    elements = np.concatenate([block.numbers for block in deck.blocks] or [np.empty(0, dtype=np.int64)])
    turning = np.unique(np.concatenate([load.elements for load in loads]))
    if turning.size and turning.size < elements.size:
        found = f"{deck.path}: {turning.size} of {elements.size} elements have a centrifugal load"
        raise SceneError("model", found, "give it to all of them")
    return Rotation(loads[0].omega_squared, loads[0].point * units.length, loads[0].axis)


def check_units(deck: Deck, mass: float | None, units: Units) -> None:
    """Raises SceneError where mass and extent, density or modulus are of no real material.

    mass: of the model, in units of the file; None where only the density of the deck is known. units: of the files
    according to the user.
    """
    used = np.unique(np.concatenate([block.nodes.ravel() for block in deck.blocks] or [deck.node_numbers]))
    sides = np.ptp(deck.coordinates[deck.rows_of_nodes(used)], axis=0)
    extent = float(sides.max())
    known = [material.density for material in deck.materials.values() if material.density is not None]
    if mass is not None:
        density = mass / math.prod(np.maximum(sides, 1e-6 * extent)) if extent > 0 else math.inf
        found = f"mass {mass:.2g} {units.label_of_mass}, extent {extent:.3g} {units.label_of_length}"
    elif known:
        density = max(known)
        found = f"density {density:.3g} {units.label_of_mass}/{units.label_of_length}3"
    else:
        return
    real = _LEAST_DENSITY <= density * units.density <= _LARGEST_DENSITY
    moduli = [material.young * units.stress for material in deck.materials.values() if material.young is not None]
    if real and mass is None and moduli and (min(moduli) > _STIFFEST or max(moduli) < _SOFTEST):
        real, found = False, f"Young's moduli {min(moduli):.3g} to {max(moduli):.3g} Pa"
    if not real:
        raise SceneError("units", f"{found}: not {units.name}", 'give `units` that fit, "SI" or "mm-t-s"')
