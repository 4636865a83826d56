"""The coordinates of a result file, and its variables that are those of the scene alone."""

from studyrunner.variables import Variable

POINT, SAMPLE = "point", "sample"
"""Dimensions of points that are rows of a table, and of drawn values."""

_AUXILIARY, _REFERENCE = "auxiliaryInformation", "referenceInformation"
_UNPLACED = "NaN where the scene does not say."
_NO_FORM = "NaN where no closed form holds."

SCENE: dict[str, dict[str, Variable]] = {
    "mesh": {
        **{
            f"mesh_{axis}": Variable(("mesh_node",), "m", f"position of the node, {axis}", content=_AUXILIARY)
            for axis in "xyz"
        },
        "mesh_quad": Variable(
            ("mesh_quad_index", "mesh_corner"),
            "1",
            "nodes of the outer face, anticlockwise from outside",
            "Indices along mesh_node.",
            dtype="int32",
            content=_AUXILIARY,
        ),
        "mesh_part": Variable(
            ("mesh_quad_index",), "1", "part that the face belongs to", dtype="str", content=_AUXILIARY
        ),
    },
    "natural_frequency": {
        "natural_frequency": Variable(
            ("nodal_diameter", "mode"),
            "Hz",
            "natural frequency with the joint stuck, without damping",
            "NaN where there are fewer modes.",
        ),
    },
    "exact": {
        "exact_worn_volume": Variable(("cycle",), "m3", "exact worn volume", _NO_FORM, content=_REFERENCE),
        "exact_response_amplitude": Variable(
            ("cycle", "response"),
            "m",
            "exact amplitude of the first harmonic of the response",
            _NO_FORM,
            content=_REFERENCE,
        ),
    },
}
"""What `outputs.variables` asks of the scene under one name; the exact answers alone have the axes of the study."""

COORDINATES = {
    "frequency": Variable((), "Hz", "excitation frequency", "Of a followed resonance the middle of loading.between."),
    "frequency_ratio": Variable(
        (),
        "1",
        "excitation frequency over the first natural frequency with the joint stuck",
        "Of the same scene; the coordinate frequency is in Hz.",
    ),
    "wear_coefficient": Variable((), "1/Pa", "wear coefficient", "Of the law under [wear] in the study."),
    "excitation_amplitude": Variable((), "N", "excitation amplitude, factor of the unit harmonic load"),
    "step": Variable((), "1", "step of the slow time scale, cycles", "Not used by the adaptive scheme."),
    "scheme": Variable((), "1", "integration scheme of the wear"),
    "sweep": Variable(
        (),
        "1",
        "how the unworn state is reached",
        "up, down: along the frequency; ramp: the excitation is raised at this frequency.",
    ),
    "harmonics": Variable((), "1", "harmonics above the static one"),
    "samples": Variable((), "1", "time samples in a period"),
    "tolerance": Variable((), "1", "largest accepted scaled residual"),
    "rtol": Variable((), "1", "relative error that automatic settings and adaptive steps aim at"),
    "modal_amplitude": Variable((), "m kg^0.5", "modal amplitude", "sqrt(x^H M x), x: first harmonic, M: mass matrix."),
    POINT: Variable((), "1", "number of the point", "A row of the design, from 0; its values are coordinates."),
    SAMPLE: Variable((), "1", "number of the sample", "What it draws is in the coordinates sample_..."),
    "cycle": Variable((), "1", "number of vibration cycles", "Slow time."),
    "mission": Variable((), "1", "number of missions", "Slow time."),
    "block": Variable((), "1", "name of the block of the mission", "In their order in a mission."),
    "contact": Variable((), "1", "index of the contact pair"),
    "response": Variable((), "1", "name of the response"),
    "phase": Variable((), "rad", "phase of the excitation", "omega t, 0 where a real harmonic load has its maximum."),
    "component": Variable((), "1", "component of relative displacement and contact force in the frame of the pair"),
    "sector": Variable((), "1", "number of the sector of the ring"),
    "nodal_diameter": Variable((), "1", "nodal diameter"),
    "mode": Variable((), "1", "number of the mode, by frequency"),
    **{
        f"contact_{axis}": Variable(("contact",), "m", f"position of the contact pair, {axis}", _UNPLACED)
        for axis in "xyz"
    },
    "contact_area": Variable(("contact",), "m2", "area of the contact pair", "Alpha in Eq. (7) of the reference."),
    "contact_surface": Variable(("contact",), "1", "label of the surface of the contact pair", dtype="str"),
    "contact_edge": Variable(
        ("contact",),
        "1",
        "whether the contact pair is at the edge of its surface",
        "Found from the positions of the pairs of flat surfaces, or given by the scene. Not known of a surface with so"
        " few pairs that all lie at its edge, as on the coarsest mesh.",
        dtype="int8",
        flags=("inside", "edge", "not_known"),
    ),
    "contact_sector": Variable(("contact",), "1", "sector of the ring that the contact pair is in", dtype="int32"),
    "sector_frequency": Variable(
        ("sector",),
        "1",
        "relative deviation of the blade-alone frequency",
        "Key scene.sectors; where it scatters, what the samples draw is in sample_sector_frequency.",
    ),
    "contact_exists": Variable(
        ("contact",),
        "1",
        "whether the scene has the contact pair",
        "Scenes of the study differ in their pairs. Values of a missing pair are NaN.",
        dtype="int8",
        flags=("missing", "present"),
    ),
}
"""Coordinates, the axes first."""

OF_SCENE = {
    **SCENE["mesh"],
    **SCENE["natural_frequency"],
    "stuck_frequency": Variable(
        (),
        "Hz",
        "first natural frequency with the joint stuck, without damping",
        "At the nodal diameter of the excitation; NaN where nothing moves that has mass.",
        content=_REFERENCE,
    ),
    "worn_depth": Variable(
        ("contact",), "m", "wear depth at the start", "Key scene.worn; wear_depth counts from there."
    ),
    **{name: entry for name, entry in COORDINATES.items() if entry.dimensions},
}
"""Arrays of the scene, with the axes along which they differ before these dimensions. What tasks compute, and the exact
answers, have all axes."""
