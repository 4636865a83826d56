"""Figures of wear histories."""

from typing import Any

from studyrunner.report.contents import AT_THE_END, BANDS, OF_POINTS, OF_WEAR, ONE, Entry
from studyrunner.report.figures import pairs, precision, response, wear

_RESPONSE: dict[str, Any] = {"needs": ("response_amplitude",)}
_LOOPS = (
    "Tangential force over relative displacement through a period, each about its mean: the area inside is the energy"
    " of friction"
)
_MOTION = "Path of the relative displacement about its mean; a pair that sticks is a dot"
_PRECISION = (
    "Each mark is one setting; a line joins those of a scheme than which no quicker one is as exact; rings: of all."
    " Open marks, in the grey: errors too small against the uncertainty of the reference"
)

FIGURES = (
    *OF_WEAR,
    Entry("frequency_response", "Frequency response of one joint, new and worn", response.draw_responses, **_RESPONSE),
    Entry("excitation_frequency", "Frequency of the followed resonance", wear.draw_excitation, caption=BANDS),
    *OF_POINTS,
    Entry("mean_pressure", "Mean pressure", pairs.draw_pressure, needs=("mean_pressure",), **ONE),
    *(
        Entry(name, title, response.draw_loops, name, caption=caption, **ONE)
        for name, title, caption in (
            ("fretting_loops", "Fretting loops", _LOOPS),
            ("normal_load", "Normal force through a period", "Where the force is zero the pair is open"),
            ("pair_motion", "Motion of the pairs in the contact plane", _MOTION),
        )
    ),
    *AT_THE_END,
    Entry("precision", "Error against run time", precision.draw_precision, caption=_PRECISION),
)
"""In the order of the page."""
