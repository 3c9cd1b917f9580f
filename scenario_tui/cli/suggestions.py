"""What may have been meant by a campaign file that is not there."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from grammars.text.diagnostics import Finding, InputError, Where, closest

_LISTED: Final = 5
"""Campaign files that are named when none is close to what was typed."""
_ENDINGS: Final = (".yaml", ".yml")


def refuse_missing_campaign(path: Path) -> None:
    """Raise :class:`InputError` for a campaign file that is not there, with those near by."""
    if not path.exists():
        raise InputError(Finding(Where(str(path)), "no such file", _hint(path)))


def refuse_missing_file(name: str) -> None:
    """Do so for what is a file by its ending; names of campaigns and runs have none."""
    if name.endswith(_ENDINGS):
        refuse_missing_campaign(Path(name))


def _hint(path: Path) -> str:
    from scenario_tui.campaign_files import find_files, is_campaign

    files = find_files(Path(), is_campaign)
    if meant := _closest_file(path, files):
        return f"did you mean {meant}?"
    if not files:
        return "there is no campaign file here: `scenario new my-tests` writes one"
    shown = ", ".join(map(str, files[:_LISTED]))
    more = f" and {len(files) - _LISTED} more" if len(files) > _LISTED else ""
    return f"campaign files here: {shown}{more}"


def _closest_file(path: Path, files: tuple[Path, ...]) -> Path | None:
    """Return the file of such a path or name, or in a folder that is called so."""
    # Without their endings, which would make any two of them alike.
    beside = {file.stem: file for file in path.parent.glob("*.y*ml")}
    known: dict[str, Path] = {}
    for file in files:
        for word in (str(file.with_suffix("")), file.stem, file.parent.name):
            known.setdefault(word, file)
    whole = str(path.with_suffix(""))
    for words, typed in ((beside, path.stem), (known, whole), (known, path.stem)):
        if word := closest(typed, words):
            return words[word]
    return None
