"""Notebooks of the documentation: executed anew, and held to the outputs that they are shown with.

Outputs are stored, so that a notebook is read with its pictures where nobody executes it: in the
repository and on the site. ``python -m tests.docs --notebooks`` writes them anew.
"""

import re
import tempfile
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient
from traitlets.config import Config

from tests.docs.markdown import DOCS, ROOT

NOTEBOOKS = sorted(DOCS.rglob("*.ipynb"))
_CAMPAIGN = re.compile(r"-[0-9a-f]{8}\b")
"""The end of a campaign's id, which changes with the version of whatever can change a run."""


def executed(path):
    """Return a notebook, executed by a kernel of this Python in a folder of its own."""
    notebook = nbformat.read(path, as_version=4)
    # Sockets of a kernel have short paths: not below the folder of a test.
    with tempfile.TemporaryDirectory(prefix="nb-") as folder, pytest.MonkeyPatch.context() as patch:
        Path(folder, "campaigns").symlink_to(ROOT / "campaigns")
        for name in ("IPYTHONDIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR", "SCENARIO_STATE"):
            patch.setenv(name, f"{folder}/{name}")
        connection = {"transport": "ipc", "ip": f"{folder}/kernel"}
        client = NotebookClient(
            notebook,
            resources={"metadata": {"path": folder}},
            config=Config(ConnectionFileMixin=connection),
        )
        client.execute()
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)  # when it was executed
    notebook.metadata.pop("language_info", None)  # the version of Python
    return notebook


def write_anew(path):
    """Execute a notebook and keep what it shows."""
    nbformat.write(executed(path), path)


def outputs(notebook):
    """Return what each cell shows: the cell, the kind and the text."""
    texts = []
    for cell in notebook.cells:
        for output in cell.get("outputs", ()):
            bundle = output.get("data") or {"text": output.get("text", "")}
            for kind, value in sorted(bundle.items()):
                texts.append((cell.id, kind, _CAMPAIGN.sub("-…", value)))
    return texts
