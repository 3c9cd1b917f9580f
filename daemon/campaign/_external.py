"""Systems under test outside of the simulation: how often they are run.

Same specification, same world and noise, but not the same answers: one run of such a system shows
less than one of a system that repeats itself.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from daemon.model.spec import SutReference
from grammars.text.diagnostics import Diagnostic, Severity
from grammars.text.documents import YamlDocument

EXTERNAL_REPEATS: Final = 5
"""Runs of a cell whose system is not repeatable, where a campaign does not say how many. As many as
the published evaluation of the reference stack has; five of five that pass show at least 55 %."""


def says_repeats(document: YamlDocument) -> bool:
    """Whether a campaign file says how often its cells are run."""
    return "repeats" in document.data


def default_repeats(suts: Iterable[SutReference]) -> int:
    """Return how often a cell of any of these is run when nobody said it."""
    return max((1 if sut.repeatable else EXTERNAL_REPEATS for sut in suts), default=1)


def announce_repeats(
    suts: Iterable[SutReference], document: YamlDocument
) -> tuple[Diagnostic, ...]:
    """Say how often cells are run whose system is not repeatable, where nobody said it."""
    names = dict.fromkeys(sut.name for sut in suts if not sut.repeatable)
    if not names or says_repeats(document):
        return ()
    message = (
        f"{', '.join(names)}: not repeatable, so every scenario is run {EXTERNAL_REPEATS} times "
        "with it; the campaign does not say how often"
    )
    where = document.where(("matrix", "sut"))
    hint = f'write "repeats: {EXTERNAL_REPEATS}" for all systems, or another number'
    return (Diagnostic(where, message, hint, Severity.WARNING),)
