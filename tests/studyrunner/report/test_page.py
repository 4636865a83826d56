"""The page as text: complete in itself, texts of the file harmless, every item in its place."""

import base64
import hashlib
import json
import re
from collections.abc import Sequence
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from studyrunner.report.drawing import Drawing, Missing, Table, new_figure
from studyrunner.report.page import page
from studyrunner.report.page.data import MOST_POINTS
from studyrunner.report.page.page import write_page
from tests.studyrunner.report.page_cases import AXES, as_result, build_file

EVIL = "</script></title><img src=x onerror=alert(1)><script>alert(2)</script>&amp;\"'{{ 7 * 7 }}{% endif %}"


class Reader(HTMLParser):
    """Elements with their attributes, and the text of each script."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[str] = []
        self.text = ""
        self._in_script = False
        self.feed(text)
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


def drawing(name, text="a", n_points=3):
    figure = new_figure(2.0)
    panel = figure.subplots()
    panel.plot(np.random.default_rng(0).random(n_points))
    panel.fill_between([0, 1], [1, 1])
    panel.set_title(text, parse_math=False)
    return Drawing(name, f"Title of {text}", f"Caption of {text}", figure)


def read(path):
    return Reader(path.read_text(encoding="utf-8"))


ITEMS: Sequence[Drawing | Missing | Table] = (
    Missing("loops", "Fretting loops", "Add pairs to [outputs] loops."),
    Table("numbers", "Numbers", ("one", "two"), (("1", "2"), ("3", "4")), "A note."),
)


FILES = ("svg", "png")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A page with all kinds of items."""
    folder = tmp_path_factory.mktemp("page")
    items = [drawing("first"), *ITEMS, drawing("second")]
    return folder, write_page(as_result(build_file(), folder / "some.nc"), items, folder / "index.html")


@pytest.fixture
def found(written):
    return read(written[0] / "index.html")


def test_items_stand_in_their_order(written, found):
    folder, summary = written
    assert (summary.n_drawings, summary.n_tables, summary.n_missing) == (2, 1, 1)
    assert summary.n_bytes == (folder / "index.html").stat().st_size
    sections = [attributes.get("id") for attributes in found.all("section")]
    assert sections == ["study", "explore", "first", "numbers", "second", "missing"]
    assert "Add pairs to [outputs] loops." in found.text
    for link in (attributes["href"] for attributes in found.all("a")):
        assert link is not None
        assert (folder / link).is_file()
    figures = {f"{name}{width}.{kind}" for name in ("first", "second") for width in ("", "_column") for kind in FILES}
    assert {path.name for path in folder.iterdir()} == {"some.nc", "index.html", *figures}


def test_nothing_comes_from_elsewhere(found):
    for tag, attributes in found.elements:
        assert tag not in ("link", "iframe", "object", "embed", "base")
        for name in ("src", "href", "xlink:href", "srcset", "data"):
            assert not re.match(r"\s*(//|\w+:)", attributes.get(name) or "")
    style = (Path(page.__file__).parent / "browser" / "page.css").read_text(encoding="utf-8")
    assert "url(" not in style
    assert "@import" not in style


def test_the_policy_allows_the_scripts_of_the_page_only(found):
    (policy,) = [each["content"] for each in found.all("meta") if each.get("http-equiv") == "Content-Security-Policy"]
    assert policy is not None
    kinds = [attributes.get("type") for attributes in found.all("script")]
    assert kinds == ["application/json", None, None]
    digests = [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in found.scripts[1:]]
    allowed = " ".join(f"'sha256-{digest}'" for digest in digests)
    assert f"script-src {allowed};" in policy
    assert "default-src 'none'" in policy


def test_texts_of_the_file_are_harmless(tmp_path):
    axes = {**AXES, "scheme": (EVIL, "explicit")}
    surfaces = [EVIL] * 12 + ["other"] * 12
    attributes = {"study": EVIL, "versions": EVIL, "source": EVIL, "scene_sha256": EVIL}
    dataset = build_file(axes, surfaces=surfaces, responses=(EVIL, "tip"), **attributes)
    dataset.attrs["title"] = EVIL
    dataset["worn_volume"].attrs["long_name"] = EVIL
    dataset["outcome"].attrs["sentences"] = "\n".join([EVIL] * 5)
    result = as_result(dataset, tmp_path / "some.nc")
    items = [drawing("first", EVIL), Table("t", EVIL, (EVIL,), ((EVIL,),), EVIL), Missing("m", EVIL, EVIL)]
    write_page(result, items, tmp_path / "index.html")
    found = read(tmp_path / "index.html")
    assert found.all("img") == []
    assert len(found.all("script")) == 3
    for _, attributes in found.elements:
        assert not any(name.startswith("on") for name in attributes)
    assert found.text.count(EVIL) >= 11
    content = json.loads(found.scripts[0])
    assert content["responses"][0] == EVIL
    assert content["maps"]["panels"][0][0]["title"] == EVIL
    assert "<" not in found.scripts[0]


@pytest.mark.slow
def test_heavy_drawings_become_pixels_until_the_rest_fits(tmp_path, monkeypatch):
    result = as_result(build_file(), tmp_path / "some.nc")
    monkeypatch.setattr(page, "_DRAWINGS_LIMIT", 1e5)
    items = [drawing("light"), drawing("heavy", n_points=20_000)]
    write_page(result, items, tmp_path / "index.html")
    images = read(tmp_path / "index.html").all("img")
    assert [image["alt"] for image in images] == ["Title of a"]
    content = (images[0]["src"] or "").removeprefix("data:image/png;base64,")
    assert base64.b64decode(content) == (tmp_path / "heavy.png").read_bytes()


@pytest.mark.slow
def test_a_page_of_a_large_study_is_below_12_megabytes(tmp_path):
    axes = {**AXES, "frequency": np.linspace(1.0, 2.0, 625).tolist()}
    result = as_result(build_file(axes, cycles=np.arange(21.0)), tmp_path / "some.nc")
    summary = write_page(result, [], tmp_path / "index.html")
    assert summary.n_bytes < 1.15e7
    assert "most worn of 2500 points" in read(tmp_path / "index.html").text


@pytest.mark.slow
def test_too_many_points_leave_a_page_without_scripts(tmp_path):
    axes = {**AXES, "frequency": np.linspace(1.0, 2.0, MOST_POINTS).tolist()}
    dataset = build_file(axes, cycles=(0.0,), positions=np.zeros((1, 3)), variables=("worn_volume",))
    summary = write_page(as_result(dataset, tmp_path / "some.nc"), [drawing("first")], tmp_path / "index.html")
    found = read(tmp_path / "index.html")
    assert found.all("script") == []
    assert "more than the" in found.text
    assert summary.n_bytes < 1e6
