"""Which run is meant: in a campaign file, in the ledger, or by its trace."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from daemon.campaign import expand, load_campaign
from daemon.places import Places
from daemon.rejudge import find_traces
from daemon.spec import RunSpec
from daemon.trace import read_spec
from grammars.diagnostics import InputError

_DEEPEST: Final = 4
"""Campaign files are looked for so many folders below the current one."""
_SKIPPED: Final = re.compile(r"\.|node_modules\Z|__pycache__\Z")


@dataclass(frozen=True, slots=True)
class Meant:
    """A run of a campaign file; ``note`` says in what it is not the run that was recorded."""

    campaign: Path
    scenario: str
    sut: str
    repeat: int
    note: str = ""


def find_run(words: Sequence[str], places: Places, campaign: Path | None = None) -> Meant:
    """Return the run that ``words`` name.

    ``CAMPAIGN.yaml SCENARIO [SUT [REPEAT]]``, or a trace, or the id of a run in the ledger. For
    the latter two the layers are needed that a trace does not hold: those of ``campaign``, else
    of the campaign file below the current folder that specifies the very run. Raises
    ``ValueError`` for what names none, :class:`InputError` for files that cannot be used.
    """
    first, *rest = words
    if first.endswith((".yaml", ".yml")):
        return _written(Path(first), rest)
    if rest:
        raise ValueError("one trace or one id of a run, or CAMPAIGN.yaml SCENARIO SUT REPEAT")
    traces = find_traces([first], places)
    if len(traces) > 1:
        raise ValueError(f"{first} names {len(traces)} runs, name one of them")
    spec = read_spec(traces[0])
    file = campaign or _specifying(spec)
    same = campaign is None or _specifies(campaign, spec)
    note = "" if same else "its layers have changed since: this is about the run as they are now"
    return Meant(file, spec.scenario, spec.sut.name, spec.repeat, note)


def _written(campaign: Path, rest: Sequence[str]) -> Meant:
    if not 1 <= len(rest) <= 3:
        raise ValueError("name a run of the campaign: SCENARIO SUT REPEAT, such as S1 pilot 0")
    scenario, sut, repeat = (*rest, *("", "0")[len(rest) - 1 :])
    if not repeat.isdecimal():
        raise ValueError(f"{repeat} is not the number of a repeat, they count from 0")
    return Meant(campaign, scenario, sut, int(repeat))


def _specifying(spec: RunSpec) -> Path:
    """Return the campaign file that specifies a run, among those of its campaign's name."""
    named = [path for path in _yaml_files(Path()) if _names(path, spec.campaign)]
    for path in named:
        if _specifies(path, spec):
            return path
    if named:
        files = ", ".join(map(str, named))
        raise ValueError(
            f"{files} does not specify this run any more: say --campaign {named[0]} "
            "to ask about the run as its layers are now"
        )
    raise ValueError(
        f"no campaign file {spec.campaign} below this folder, and a trace does not hold the "
        "layers: say --campaign FILE"
    )


def _yaml_files(folder: Path) -> Iterator[Path]:
    for place, folders, files in os.walk(folder):
        depth = len(Path(place).parts)
        wanted = [name for name in sorted(folders) if not _SKIPPED.match(name)]
        folders[:] = wanted if depth < _DEEPEST else []
        yield from (Path(place, name) for name in sorted(files) if name.endswith((".yaml", ".yml")))


def _names(path: Path, campaign: str) -> bool:
    pattern = rf"^campaign:\s*[\"']?{re.escape(campaign)}[\"']?\s*(#.*)?$"
    try:
        return re.search(pattern, path.read_text(encoding="utf-8"), re.MULTILINE) is not None
    except (OSError, UnicodeDecodeError):
        return False


def _specifies(path: Path, spec: RunSpec) -> bool:
    try:
        runs = expand(load_campaign(path)).runs
    except InputError:
        return False
    return any(run.digest == spec.digest for run in runs)
