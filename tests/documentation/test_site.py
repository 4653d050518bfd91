"""The documentation site is built without warnings, holds every page, and is read without a network."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from hybrid_model import models

DOCS = Path(__file__).parents[2] / "docs"
PAGES = sorted(page.relative_to(DOCS).with_suffix("") for end in ("md", "rst") for page in DOCS.rglob(f"*.{end}"))


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site, built as `make docs` does it."""
    target = tmp_path_factory.mktemp("site")
    # Pages and what they refer to stay to the end: a tenth of the time went into looking through them for garbage.
    program = "import gc, sys; gc.disable(); from sphinx.cmd.build import main; sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", program, "-W", "--keep-going", "-q", str(DOCS), str(target)]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (built.returncode, built.stderr) == (0, "")
    return target


def test_every_page_is_in_the_table_of_contents(site):
    contents = (site / "index.html").read_text(encoding="utf-8")
    wanted = {f"{page.as_posix()}.html" for page in PAGES if page.name != "index"}
    assert wanted - set(re.findall(r'class="reference internal" href="([^"#]+)"', contents)) == set()


def test_the_gallery_has_every_model_and_the_file_that_it_is_in():
    text = (DOCS / "gallery.rst").read_text(encoding="utf-8")
    entries = re.findall(r"\.\. model:: (\w+)\n +:classes: (.+)\n", text)
    shown = {name: file for file, names in entries for name in names.split()}
    files = {name: getattr(models, name).__module__.rpartition(".")[2] for name in models.__all__}
    assert shown == files


def test_nothing_on_a_page_is_loaded_from_elsewhere(site):
    loaded = re.compile(r'<(?:script|img|link rel="stylesheet")[^>]*(?:src|href)="([a-z]+:)?//', re.IGNORECASE)
    assert [page.name for page in site.rglob("*.html") if loaded.search(page.read_text(encoding="utf-8"))] == []
