"""Sections of the page as HTML. Texts of the file are escaped."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from html import escape

import numpy as np

from studyrunner.report.drawing import Drawing, Missing, Table
from studyrunner.report.page.data import PageData
from studyrunner.report.reading.reliance import describe_ended, tell_ends, tell_volumes
from studyrunner.report.reading.result import CONVERGED, Result, units_of
from studyrunner.report.reading.units import show_cycles, show_number
from studyrunner.system.progress import count

_MOST_VALUES = 12

_FRAME = """\
<noscript><p class="notes">The interactive part needs JavaScript; the figures below do not.</p></noscript>
<section id="explore" hidden>
<h2>Explore</h2>
<p>Click a point of the response to pick it, or choose its values in the lists; the slider runs through the cycles.</p>
{notes}
<form id="choices" autocomplete="off"></form>
<div id="slider-row"><label for="cycle">cycle</label>
<input type="range" id="cycle" min="0" step="1"><output id="cycle-count" for="cycle"></output></div>
<p id="selected" aria-live="polite"></p>
<div class="plots">
<div class="plot"><h3 id="response-title"></h3><div id="response-plot"></div>
<p class="hint" id="response-hint"></p></div>
<div class="plot"><h3 id="map-title"></h3><div id="map-choice"></div><div id="map-plot"></div></div>
<div class="plot" id="course-part"><h3>Wear over the cycles</h3><div id="course-plot"></div></div>
<div class="plot" id="loop-part"><h3 id="loop-title"></h3><div id="loop-choice"></div><div id="loop-plot"></div></div>
</div>
<h3>The picked point in numbers</h3>
<dl id="readout"></dl>
</section>
<p id="explore-failed" class="notes" hidden>The interactive part did not start here; the figures below hold.</p>"""


def study_section(result: Result) -> str:
    """What was studied and how it ended."""
    attributes = result.dataset.attrs
    rows = [(name.replace("_", " "), _axis_values(result, name)) for name in result.axes]
    cycles = result.cycles
    kept = f"{show_cycles(float(cycles[0]))} to {show_cycles(float(cycles[-1]))}, {len(cycles)} kept"
    rows.append(("cycles", kept if len(cycles) > 1 else show_cycles(float(cycles[0]))))
    rows.append(("scene", _scene(result)))
    rows += [(name, str(attributes[name])) for name in ("source", "versions") if name in attributes]
    if "scene_sha256" in attributes:
        rows.append(("hash of the scene", str(attributes["scene_sha256"])))
    facts = "".join(f"<tr><th scope=row>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in rows)
    details = ""
    if "study" in attributes:
        study = escape(str(attributes["study"]))
        details = f"<details><summary>The whole study, all defaults filled in</summary><pre>{study}</pre></details>"
    return (
        f'<section id="study"><h2>The study</h2>{_outcomes(result)}<div class="scroll"><table class="facts"><tbody>'
        f"{facts}</tbody></table></div>{details}</section>"
    )


def _axis_values(result: Result, name: str) -> str:
    axis = result.dataset[name]
    words = axis.dtype.kind not in "fiu"
    values = [str(value) if words else show_number(float(value)) for value in axis.values]
    units = units_of(name)
    after = f" {units}" if units else ""
    if len(values) > _MOST_VALUES:
        return f"{values[0]} to {values[-1]}{after}, {len(values)} values"
    return ", ".join(values) + after


def _scene(result: Result) -> str:
    n_pairs = count(result.dataset.sizes["contact"], "contact pair")
    responses = f", response {', '.join(result.responses)}" if result.responses else ""
    model = result.study.get("scene", {}).get("model")
    return f"{model or 'unknown'}: {n_pairs}{responses}"


def _outcomes(result: Result) -> str:
    """How well the worn volume is known, and how many points ended how, in sentences."""
    n_points, n_computed = result.computed.size, int(np.count_nonzero(result.computed))
    text = f"<p>{escape(' '.join(filter(None, (tell_volumes(result), tell_ends(result)))))}</p>"
    numbers = Counter(result.dataset["outcome"].values.ravel().tolist())
    if n_computed == n_points and set(numbers) == {CONVERGED}:
        return text
    items = "".join(
        f"<li>{count(numbers[number], 'point')}: {escape(ending.sentence)}{_named(result, number)}</li>"
        for number, ending in sorted(result.endings.items())
        if numbers[number] and number != CONVERGED
    )
    return f'{text}<ul class="outcomes">{items}</ul>'


def _named(result: Result, number: int) -> str:
    """The first points of an outcome, each with what there is to say of it."""
    lines = describe_ended(result, number)
    return f"<ul>{''.join(f'<li>{escape(line)}</li>' for line in lines)}</ul>" if lines else ""


def interactive_section(data: PageData) -> str:
    """The frame that the script fills; it stays hidden until the script has done so."""
    notes = "".join(f"<li>{escape(note)}</li>" for note in data.notes)
    notes = f'<ul class="notes">{notes}</ul>' if notes else ""
    if data.content is None:
        return f'<section id="explore-missing"><h2>Explore</h2>{notes}<p>The figures below remain.</p></section>'
    return _FRAME.format(notes=notes)


def figure_section(drawing: Drawing, markup: str) -> str:
    """A drawing with its caption and its files. markup: of the picture."""
    name = escape(drawing.name)
    links = " ".join(f'<a href="{name}.{kind}">{kind.upper()}</a>' for kind in ("svg", "png"))
    return (
        f'<section class="figure" id="{name}"><h2>{escape(drawing.title)}</h2><figure><div class="scroll">{markup}'
        f'</div><figcaption>{escape(drawing.caption)} <span class="files">{links}</span>'
        f"</figcaption></figure></section>"
    )


def table_section(table: Table) -> str:
    """A table as a table."""
    head = "".join(f"<th scope=col>{escape(name)}</th>" for name in table.columns)
    rows = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in table.rows)
    note = f"<p>{escape(table.note)}</p>" if table.note else ""
    return (
        f'<section class="table" id="{escape(table.name)}"><h2>{escape(table.title)}</h2><div class="scroll"><table>'
        f"<thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>{note}</section>"
    )


def missing_section(missing: Sequence[Missing]) -> str:
    """What the file does not hold; empty where nothing is missing."""
    if not missing:
        return ""
    items = "".join(f"<li><strong>{escape(each.title)}</strong>: {escape(each.sentence)}</li>" for each in missing)
    return f'<section id="missing"><h2>Not in this file</h2><ul>{items}</ul></section>'
