"""From a campaign file to what the daemon takes, for the command line and the dashboard alike."""

from __future__ import annotations

from pathlib import Path

from daemon.protocol import Receipt, Submission
from grammars.diagnostics import Diagnostic, InputError, Severity
from scenario_tui.wording import counted


def prepare(path: Path, *, fresh: bool = False) -> tuple[Submission, tuple[Diagnostic, ...]]:
    """Load, check and expand a campaign; returns the warnings too.

    Raises :class:`InputError` with everything found when there is an error.
    """
    from daemon.campaign import check, expand, load_campaign

    campaign = load_campaign(path)
    found = check(campaign)
    if any(d.severity is Severity.ERROR for d in found):
        raise InputError(found)
    return expand(campaign, fresh=fresh), tuple(found)


def tell_receipt(receipt: Receipt) -> str:
    """Say what became of a submission."""
    runs = counted(receipt.runs, "run")
    if receipt.known:
        return f"{receipt.campaign} is known already, its {runs} are kept (--fresh runs them anew)"
    cached = f", {receipt.cached:,} cached (--fresh runs them anew)" if receipt.cached else ""
    return f"submitted {receipt.campaign}: {runs}{cached}"
