"""The summary of a result in at most nine lines of plain text: the answer first, then failures, then certainty."""

from __future__ import annotations

import math

from studyrunner.summary.answer import Failure, ModeRange, Samples, Summary
from studyrunner.summary.wear import Deepest, Life, MeshChange, MostWear, NothingWore, Number, Vibration
from studyrunner.system.progress import count
from studyrunner.units import scale_for, show_cycles, show_number, show_percent

MOST_LINES = 9
_MOST_FAILURES, _MOST_MODES, _MOST_DOUBTS = 2, 4, 1
_WIDTH, _LONGEST = 12, 240
_LEAST = 1e-4  # relative error that is shown, of any smaller one
_PLAIN = str.maketrans({"±": "+-", "³": "3", "²": "2", "µ": "u", "√": " sqrt ", "\N{NO-BREAK SPACE}": " "})
_SHARE = 0.5
"""Of the wear of a surface that lies at its edge: more, and more than its share of the area, is pointed out."""


def summary_lines(summary: Summary) -> tuple[str, ...]:
    """Lines of plain text: label and text of `summary_rows`."""
    return tuple(f"{label:<{_WIDTH}}{text}".translate(_PLAIN) for label, text in summary_rows(summary))


def summary_rows(summary: Summary) -> tuple[tuple[str, str], ...]:
    """Label and text of each line, in the order in which an engineer asks."""
    rows: list[tuple[str, str]] = []
    wear, samples = summary.wear, summary.samples
    if isinstance(wear, NothingWore):
        rows.append(("wear", _nothing(wear, summary)))
    elif samples is not None:
        rows.append(("wear", _samples(samples, summary)))
        rows += [("input", samples.ranking)] if samples.ranking else []
    elif isinstance(wear, MostWear):
        rows.append(("most wear" if wear.n_compared > 1 else "wear", _most(wear, summary)))
    elif summary.certainty is not None and summary.certainty.of == "worn volume":
        rows.append(("wear", "no worn volume is known within 50 %"))
    if isinstance(wear, MostWear):
        at = f" in the sample that wears most ({wear.where})" if samples is not None else ""
        rows.append(("deepest", _deepest(wear.deepest, at)))
        if wear.blocks:
            shares = ", ".join(f"{name} {show_percent(share)}" for name, share in wear.blocks)
            rows.append(("blocks", f"share of the wear: {shares}"))
    if summary.vibration is not None:
        rows.append(_vibration(summary.vibration, summary))
    rows += [(f"mode {mode.number}", _mode(mode)) for mode in summary.modes[:_MOST_MODES]]
    if summary.life is not None:
        rows.append(("life", _life(summary.life, summary)))
    if summary.mesh is not None:
        rows.append(("mesh", _mesh(summary.mesh)))
    for each in summary.failures[:_MOST_FAILURES]:
        rows.append(("uncertain" if each.is_complete else "failed", _failure(each, summary.n_points)))
    if left := summary.failures[_MOST_FAILURES:]:
        label, text = rows[-1]
        rows[-1] = label, f"{text}; {count(sum(each.n_points for each in left), 'point')} ended otherwise"
    rows += [("beware", doubt) for doubt in summary.doubts[:_MOST_DOUBTS]]
    rows = rows[: MOST_LINES - 1]
    if summary.certainty is not None:
        rows.append(("certainty", summary.certainty.sentence))
    return tuple(rows)


def _show(value: float, units: str) -> str:
    return scale_for(units, value).show(value)


def _known(number: Number, units: str, unknown: str = " (error not known)") -> str:
    """A number with its error: "1.52 mm3 ± 1.3 %"."""
    text = _show(number.value, units)
    if math.isnan(number.error):
        return f"{text}{unknown}"
    return f"{text} ± {show_percent(max(number.error / number.value, _LEAST))}" if number.value > 0.0 else text


def _most(wear: MostWear, summary: Summary) -> str:
    at = f" at {wear.where}" if wear.where else ""
    text = f"{_known(wear.volume, 'm3')} after {show_cycles(wear.count, summary.counted)}{at}"
    if wear.n_left_out:
        more = f"{count(wear.n_left_out, 'case')} without a known volume"
        text += f", the most of {wear.n_compared} cases; {more} may wear more"
    return text


def _samples(samples: Samples, summary: Summary) -> str:
    after = f" after {show_cycles(summary.wear.count, summary.counted)}" if isinstance(summary.wear, MostWear) else ""
    at = f", at {samples.where}" if samples.where else ""
    more = f" (of {samples.n_points} points the one with the largest median)" if samples.n_points > 1 else ""
    return f"{samples.volumes}{after}{at}{more}"


def _deepest(deepest: Deepest, where: str) -> str:
    text = _known(deepest.depth, "m")
    if deepest.pair is not None:
        text += f" at contact pair {deepest.pair}" + (f" of {deepest.surface}" if deepest.surface else "")
        if all(map(math.isfinite, deepest.position)):
            text += f", (x, y, z) = ({', '.join(f'{1e3 * each:.4g}' for each in deepest.position)}) mm"
    text += where
    if deepest.edge_share > max(_SHARE, deepest.edge_area):
        shown = "all" if deepest.edge_share > 0.995 else show_percent(deepest.edge_share)
        what = f"the wear of {deepest.surface}" if deepest.surface else "the wear"
        text += f"; {shown} of {what} is in edge pairs: valid if the real contact ends there, else extend the model"
    return text


def _nothing(wear: NothingWore, summary: Summary) -> str:
    why = ""
    if wear.largest_slip == 0.0:
        why = ": all pairs stick"
    elif wear.largest_slip > 0.0:
        why = f": pairs slip by up to {_show(wear.largest_slip, 'm')} without wear"
    stuck = f" (first resonance {summary.stuck_frequency:.4g} Hz)" if math.isfinite(summary.stuck_frequency) else ""
    return f"nothing wore{why} {wear.where}{stuck}"


def _vibration(vibration: Vibration, summary: Summary) -> tuple[str, str]:
    if all(each.value == 0.0 for each in vibration.amplitude):
        return "response", f"{vibration.of} does not move"
    without_error = all(math.isnan(each.error) for each in vibration.amplitude)
    unknown = "" if without_error else " (error not known)"
    first, last = (
        "not known" if math.isnan(each.value) else _known(each, "m", unknown) for each in vibration.amplitude
    )
    start, end = vibration.frequency
    worn = isinstance(summary.wear, MostWear)
    if vibration.followed:
        known = "" if math.isnan(end.error) else f" ± {end.error:.2g}"
        moved = f"moved from {start:.6g} to {end.value:.6g}{known} Hz" if worn else f"at {start:.6g} Hz"
        return vibration.followed, f"{moved}, response of {vibration.of} {f'{first} to {last}' if worn else first}"
    at = ""
    if summary.n_points > 1:
        case = " in that sample" if summary.samples else " in this case"
        at = case if worn else f", most at {vibration.where}"
    text = f"{vibration.of}{at}: amplitude {first}"
    text += f" when new, {last} when worn" if worn else ""
    start_of, end_of = vibration.amplitude
    text += " (its resonance may lie elsewhere)" if worn and end_of.value < start_of.value else ""
    text += " (errors not known)" if without_error else ""
    if math.isfinite(start):
        text += f"; the new joint responds most at {start:.6g} Hz ({_show(vibration.peak, 'm')})"
    if worn and math.isfinite(summary.stuck_frequency):
        text += f"; first resonance {summary.stuck_frequency:.4g} Hz when all pairs stick"
    return "response", text


def _life(life: Life, summary: Summary) -> str:
    units = {"wear_depth": "m", "worn_volume": "m3"}.get(life.quantity, "1")
    target = f"{life.quantity.replace('_', ' ')} {_show(life.target, units)}"
    unsure = f"; the life of {count(life.n_unsure, 'point')} is not known" if life.n_unsure else ""
    if math.isnan(life.count.value):
        return f"no {'other ' if unsure else ''}point computed to the end reaches {target}{unsure}"
    known = "(error not known)"
    if math.isfinite(life.count.error):
        known = f"± {show_percent(life.count.error / life.count.value)}"
    text = f"{show_cycles(round(life.count.value), summary.counted)} {known} to {target}"
    text += f" at {life.where} (the shortest life)" if life.where and summary.n_points > 1 else ""
    verb = "does" if life.n_beyond == 1 else "do"
    return text + unsure + (f"; {count(life.n_beyond, 'point')} {verb} not reach the target" if life.n_beyond else "")


def _mode(mode: ModeRange) -> str:
    if not mode.n_found:
        return f"found at none of {count(mode.n_points, 'point')}"
    frequency, damping = (
        " to ".join(dict.fromkeys(f"{factor * each:.{digits}g}{unit}" for each in ends))
        for ends, factor, digits, unit in ((mode.frequency, 1.0, 6, ""), (mode.damping, 100.0, 3, " %"))
    )
    found = "" if mode.n_found == mode.n_points else f", found at {mode.n_found} of {mode.n_points} points"
    over = f" over {mode.over}" if mode.over else ""
    return f"natural frequency {frequency} Hz, damping ratio {damping}{over}{found}"


def _mesh(mesh: MeshChange) -> str:
    coarse, fine = (show_number(each) for each in mesh.meshes)
    text = f"worn volumes of meshes {coarse} and {fine} differ by {show_percent(mesh.median)} {mesh.at}"
    return f"{text}, at most {show_percent(mesh.largest)}" if mesh.largest > mesh.median else text


def _failure(failure: Failure, n_points: int) -> str:
    said = [failure.sentence or failure.word, failure.advice]
    reason = failure.reason
    if len(reason) > _LONGEST:
        reason = f"{reason[:_LONGEST].rsplit(' ', 1)[0]} ..."
    first = ": ".join(filter(None, (failure.where, reason)))
    said.append(f"First: {first}" if failure.where else reason[:1].upper() + reason[1:])
    text = ". ".join(each.rstrip(".") if each != said[-1] else each for each in said if each)
    return f"{failure.n_points} of {count(n_points, 'point')}: {text}" if n_points > 1 else text
