"""Settings of systems under test with their places, as texts: launched.txt, folders.txt.

The format is that of :mod:`tests.languages.errors.goldens`. The answer to a case without words is
all settings and findings of the checked file; others have the lines that differ, or the errors.
"""

import difflib
from pathlib import Path

import pytest

from daemon.campaign import LayerLibrary, LayerReference
from grammars.text.diagnostics import InputError, Where
from tests.languages.errors.goldens import finding_lines, renew

HERE = Path(__file__).parent


def settings(path):
    """Return the settings of a system under test, and the findings about it."""
    library = LayerLibrary(path.parent)
    try:
        library.sut(LayerReference(path.stem, {}, Where("campaign.yaml", 1, 1)))
    except InputError as refusal:
        return finding_lines(refusal.findings)
    found = library.sut_file(path)
    lines = [f"{'/'.join(at)}: {one.value} ({one.where})\n" for at, one in found.settings.items()]
    return lines + finding_lines(library.warnings)


@pytest.mark.parametrize("name", ["launched", "folders", "stacks"])
def test_settings(name, golden, tmp_path):
    plain = {}

    def describe(path):
        lines = [line.replace(f"{path.parent}/", "") for line in settings(path)]
        # The first case of each row of files is the one without words.
        first = plain.setdefault(frozenset(path.parent.rglob("*")), lines)
        if first is lines or ": error: " in "".join(lines):
            return "".join(lines)
        return "".join(
            f"{line[0]} {line[1:]}"
            for line in difflib.unified_diff(first, lines, n=0)
            if not line.startswith(("---", "+++", "@@"))
        )

    golden(f"{name}.txt", renew(HERE / f"{name}.txt", tmp_path / "files", describe))
