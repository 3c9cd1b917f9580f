"""Origin of a campaign: its file, and the commit of the folder it lies in."""

from __future__ import annotations

import hashlib
import os
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from daemon.campaign._campaign import Campaign

if TYPE_CHECKING:
    from daemon.model.submission import CampaignOrigin

_PATIENCE: Final = 5.0
"""Seconds git may take: of a repository on a slow disk nothing is said then."""
_OF_PEOPLE: Final = (
    "GIT_CEILING_DIRECTORIES", "GIT_CONFIG_GLOBAL", "GIT_CONFIG_NOSYSTEM", "GIT_CONFIG_SYSTEM",
    "GIT_DISCOVERY_ACROSS_FILESYSTEM", "GIT_EXEC_PATH",
)  # fmt: skip
"""Variables that say how git works here; all others are about one repository or one call."""


def campaign_origin(campaign: Campaign, file: Path) -> CampaignOrigin:
    """Return where a campaign was written that was loaded from ``file``.

    Nothing is said of the commit without git, outside of a repository, in one that git does not
    trust, and of a file that is to be ignored there: one of ours in somebody's environment, say.
    ``changed`` means that a file which git knows differs from the commit, or that git does not know
    the campaign's file.
    """
    # Loaded for who submits: a campaign that is only checked comes from nowhere.
    from daemon.model.submission import CampaignOrigin

    digest = hashlib.sha256(campaign.source.encode()).hexdigest()
    unknown = CampaignOrigin(file.name, digest, campaign.seed, path=str(file.absolute()))
    how = ("--porcelain=v2", "--branch", "--no-ahead-behind", "--untracked-files=no")
    status = _git(file.parent, "status", *how)
    if status is None:
        return unknown
    tracked = _git(file.parent, "ls-files", "--error-unmatch", "--", file.name) is not None
    if not tracked and _git(file.parent, "check-ignore", "-q", "--", file.name) is not None:
        return unknown
    lines = status.splitlines()
    heads = dict(line[2:].split(" ", 1) for line in lines if line.startswith("# branch."))
    commit, branch = heads.get("branch.oid", ""), heads.get("branch.head", "")
    return replace(
        unknown,
        commit="" if commit == "(initial)" else commit,
        branch="" if branch == "(detached)" else branch,
        changed=not tracked or any(not line.startswith("#") for line in lines),
    )


def _git(folder: Path, *words: str) -> str | None:
    """Return what git says about the folder, ``None`` when it says no, or nothing in time."""
    # Looking must change nothing (no lock, no refreshed index) and start nothing: the settings of
    # a repository may name a program that watches it. Answers must not depend on the language.
    command = ["git", "-c", "core.fsmonitor=false", "-C", str(folder), *words]
    # A hook of another repository, from which tests may be started, names its index and objects.
    environment = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith("GIT_") or name in _OF_PEOPLE
    } | {"GIT_OPTIONAL_LOCKS": "0", "LC_ALL": "C"}
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_PATIENCE,
            env=environment,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.decode("utf-8", errors="replace")
