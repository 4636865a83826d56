"""The page as text: complete in itself, texts harmless, every item in its place, numbers those of the file."""

import base64
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np

from studyrunner.report import page
from studyrunner.report.drawing import Drawing, Missing, Table, new_panel
from studyrunner.report.page import build_page_data, write_page
from studyrunner.result.view import Result
from tests.studyrunner.results import AXES, as_result, build_file

EVIL = "</script></title><img src=x onerror=alert(1)><script>alert(2)</script>&amp;\"'{{ 7 * 7 }}{% endif %}"


class Reader(HTMLParser):
    """Elements with their attributes, the text of each script, and all other text."""

    def __init__(self, path):
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[str] = []
        self.text = ""
        self._in_script = False
        self.feed(path.read_text(encoding="utf-8"))
        self.close()

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        self._in_script = tag == "script"
        if self._in_script:
            self.scripts.append("")

    def handle_endtag(self, tag):
        self._in_script = self._in_script and tag != "script"

    def handle_data(self, data):
        if self._in_script:
            self.scripts[-1] += data
        else:
            self.text += data

    def all(self, tag):
        return [attributes for name, attributes in self.elements if name == tag]


def drawing(name, text="a"):
    def figure():
        found, panel = new_panel(2.0)
        panel.plot([0.1, 0.3, 0.2], color="black")
        panel.fill_between([0, 1], [1, 1])
        panel.set_title(text, parse_math=False)
        return found

    return Drawing(name, f"Title of {text}", f"Caption of {text}", figure())


def test_items_stand_in_their_order_and_nothing_comes_from_elsewhere(tmp_path):
    table = Table(("one", "two"), (("1", "2"), ("3", "4")), "A note.", "numbers", "Numbers")
    items = [drawing("first"), Missing("loops", "Fretting loops", "Add pairs."), table, drawing("second")]
    summary = write_page(as_result(build_file(), tmp_path / "some.nc"), items, tmp_path / "index.html")
    assert summary.startswith("2 figures, 1 table, 1 left out, ")
    found = Reader(tmp_path / "index.html")
    sections = [attributes.get("id") for attributes in found.all("section")]
    assert sections == ["study", "explore", "first", "numbers", "second", "missing"]
    links = [attributes["href"] or "" for attributes in found.all("a")]
    assert [link for link in links if link.startswith("#")] == [f"#{section}" for section in sections]
    assert all((tmp_path / link).is_file() for link in links if not link.startswith("#"))
    names = {name + kind for name in ("first", "second") for kind in (".svg", ".png", ".csv")}
    assert {path.name for path in tmp_path.iterdir()} == {"some.nc", "index.html", *names}
    for tag, attributes in found.elements:
        assert tag not in ("link", "iframe", "object", "embed", "base")
        for name in ("src", "href", "xlink:href", "srcset", "data"):
            assert not re.match(r"\s*(//|(?!data:image)\w+:)", attributes.get(name) or "")
    style = (Path(page.__file__).parent / "browser" / "page.css").read_text(encoding="utf-8")
    assert not re.search(r"url\(|@import", style)
    assert len(found.all("svg")) == 2
    (policy,) = [each["content"] for each in found.all("meta") if each.get("http-equiv") == "Content-Security-Policy"]
    assert "default-src 'none'" in (policy or "")


def test_texts_of_the_file_are_harmless(tmp_path):
    axes = {**AXES, "scheme": (EVIL, "explicit")}
    surfaces = [EVIL] * 12 + ["other"] * 12
    attributes = dict.fromkeys(("study", "versions", "source", "scene_sha256", "title"), EVIL)
    dataset = build_file(axes, surfaces=surfaces, responses=(EVIL, "tip"), **attributes)
    dataset["worn_volume"].attrs["long_name"] = EVIL
    dataset["outcome"].attrs["sentences"] = "\n".join([EVIL] * 5)
    items = [drawing("first", EVIL), Table((EVIL,), ((EVIL,),), EVIL, "t", EVIL), Missing("m", EVIL, EVIL)]
    write_page(as_result(dataset, tmp_path / "some.nc"), items, tmp_path / "index.html")
    found = Reader(tmp_path / "index.html")
    assert found.all("img") == []
    assert len(found.all("script")) == 3
    assert not any(name.startswith("on") for _, attributes in found.elements for name in attributes)
    assert found.text.count(EVIL) >= 9
    (response,) = [entry for entry in json.loads(found.scripts[0])["dims"] if entry["name"] == "response"]
    assert response["values"][0] == EVIL
    assert "<" not in found.scripts[0]


def decode(entry, array):
    """Values of an entry, and as they stand in the file."""
    values = np.frombuffer(base64.b64decode(entry["data"]), dtype="<f4")
    return values.reshape(array.shape), array.values.astype("f4")


def test_the_page_holds_the_variables_of_the_file_with_their_errors():
    dataset = build_file(failed=[3, 8], loops=[2, 5], responses=["tip", "root"])
    notes: list[str] = []
    content = json.loads(json.dumps(build_page_data(Result(Path("some.nc"), dataset), 4e6, notes), allow_nan=False))
    assert notes == []
    entries = {entry["name"]: entry for entry in content["variables"]}
    assert set(entries) == {str(name) for name, array in dataset.data_vars.items() if array.dtype.kind in "iuf"}
    for name, entry in entries.items():
        array = dataset[name].isel(contact=[2, 5]) if name.startswith("loop") else dataset[name]
        np.testing.assert_array_equal(*decode(entry, array))
    for name, error, relative in (
        ("worn_volume", "worn_volume_error", True),
        ("wear_depth", "wear_depth_error", False),
        ("response_amplitude", "response_error", True),
    ):
        assert (entries[name]["error"], entries[name]["relative"]) == (error, relative)
    assert entries["outcome"]["words"]["4"] == "march failed"
    dims = {entry["name"]: entry["values"] for entry in content["dims"]}
    assert dims.pop("pair_of_loop") == [2, 5]
    assert {name: len(values) for name, values in dims.items()} == {name: dataset.sizes[name] for name in dims}


def test_counts_are_thinned_out_where_there_is_too_little_room():
    dataset = build_file(cycles=np.linspace(0.0, 1e4, 101))
    whole, notes = build_page_data(Result(Path("some.nc"), dataset), 1e8, []), []
    limit = 0.2 * len(json.dumps(whole))
    content = build_page_data(Result(Path("some.nc"), dataset), limit, notes)
    assert len(json.dumps(content)) < 1.5 * limit
    kept = next(entry["values"] for entry in content["dims"] if entry["name"] == "cycle")
    assert [kept[0], kept[-1], content["at"]["cycle"]] == [0.0, 1e4, len(kept) - 1]
    entries = {entry["name"]: entry for entry in content["variables"]}
    for name in ("worn_volume", "wear_depth"):
        np.testing.assert_array_equal(*decode(entries[name], dataset[name].sel(cycle=kept)))
    assert f"{len(kept)} of 101" in notes[0]


def test_a_study_of_many_points_has_no_interactive_part(tmp_path):
    axes = {**AXES, "frequency": np.linspace(1.0, 2.0, 20_001).tolist()}
    dataset = build_file(axes, cycles=(0.0,), positions=np.zeros((1, 3)), variables=("worn_volume",))
    write_page(as_result(dataset, tmp_path / "more.nc"), [], tmp_path / "more.html")
    assert (tmp_path / "more.html").stat().st_size < 1e6
    assert Reader(tmp_path / "more.html").all("script") == []
