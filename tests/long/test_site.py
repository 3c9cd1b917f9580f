"""The documentation as a site, where its generator is installed (``make docs`` installs it)."""

import importlib.util
import re
import subprocess
import sys

import pytest

from tests.docs.markdown import DOCS

_MISSING = [
    name
    for name in ("sphinx", "furo", "myst_nb", "sphinx_copybutton")
    if not importlib.util.find_spec(name)
]
_FETCHED = re.compile(r"""(?:src=|<link[^>]*href=|@import\s+|url\()["']?https?:""")


@pytest.mark.skipif(bool(_MISSING), reason="the site's generator is not installed")
def test_the_site_is_built_without_a_warning_and_fetches_nothing(tmp_path):
    options = ["--fail-on-warning", "--keep-going", "--nitpicky", "--quiet"]
    command = [sys.executable, "-m", "sphinx", *options, str(DOCS), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert done.returncode == 0
    assert (tmp_path / "searchindex.js").exists()
    files = [path for path in tmp_path.rglob("*") if path.suffix in (".html", ".css")]
    assert [path.name for path in files if _FETCHED.search(path.read_text("utf-8"))] == []
