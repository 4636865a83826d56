"""The HTML site of the pages, the Python functions and the notebooks.

    .venv/bin/sphinx-build -W --keep-going -b html -c docs . build/site

The root of the repository is the source folder, so that the links between the pages are those that hold in a checkout.
A broken link is a warning, and a warning is an error. Notebooks are not run: the site shows their stored outputs.
"""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).parents[1]
_PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

project = _PROJECT["name"]
release = version = _PROJECT["version"]
author = _PROJECT["authors"][0]["name"]
root_doc = "README"
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode", "sphinx_copybutton"]
# Only these are pages.
include_patterns = ["docs/*.md", "*.md", "solver/*.md", "studies/*.md", "studies/fe_models/*.md", "studyrunner/*.md"]
include_patterns += ["studies/notebooks/*.ipynb"]

nb_execution_mode = "off"
myst_heading_anchors = 3
suppress_warnings = ["myst.header"]
default_role = "code"

autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
napoleon_google_docstring = False

html_theme = "furo"
html_title = f"{project} {version}"
html_show_copyright = False


def setup(app: Sphinx) -> None:
    """Adds the list of all pages to the README, the first page, and a picture of each notebook."""

    def add_to_page(_: Sphinx, page: str, source: list[str]) -> None:
        if page == root_doc:
            source[0] += "\n" + Path(__file__).with_name("contents.txt").read_text(encoding="utf-8")
        elif page == "docs/notebooks":
            source[0] += "\n" + "\n".join(map(_thumbnail, sorted(ROOT.glob("studies/notebooks/*.ipynb"))))

    app.connect("source-read", add_to_page)


def _thumbnail(notebook: Path) -> str:
    """HTML of a notebook's first stored picture, with a link to the notebook; empty for a notebook without pictures."""
    outputs = [
        output.get("data", {})
        for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]
        for output in cell.get("outputs", ())
    ]
    picture = next((data["image/png"] for data in outputs if "image/png" in data), None)
    if picture is None:
        return ""
    style, source = "width: 30%; margin: 1%; background: white", f"data:image/png;base64,{picture.strip()}"
    image = f'<img style="{style}" alt="{notebook.stem}" src="{source}">'
    return f'<a href="../studies/notebooks/{notebook.stem}.html">{image}</a>'
