"""What a scene can tell beside its reduced model: its mesh, its natural frequencies, an exact answer."""

from __future__ import annotations

from dataclasses import dataclass

from solver.model import FloatArray, IntArray

N_MODES = 6
"""Natural frequencies that are told of each nodal diameter."""


@dataclass(frozen=True)
class SurfaceMesh:
    """Outer faces of a finite-element mesh, for pictures.

    nodes (n_nodes, 3): m. quads (n_quads, 4): nodes of each face, anticlockwise as seen from outside. parts: label of
    the part that each face belongs to, e.g. "blade".
    """

    nodes: FloatArray
    quads: IntArray
    parts: tuple[str, ...]


@dataclass(frozen=True)
class NaturalFrequencies:
    """Natural frequencies with the joint stuck, undamped.

    nodal_diameters: ascending; 0 only where the structure is no cyclic sector. frequencies (n_nodal_diameters,
    N_MODES): Hz, ascending; NaN where there are fewer modes.
    """

    nodal_diameters: tuple[int, ...]
    frequencies: FloatArray


@dataclass(frozen=True)
class ExactAnswer:
    """Exact answer at one frequency and excitation amplitude, NaN where it does not hold.

    worn_volume (n_wear, n_cycles): m3, for some wear coefficients. response_amplitude (n_wear, n_cycles, n_response):
    amplitude of the first harmonic, m.
    """

    worn_volume: FloatArray
    response_amplitude: FloatArray
