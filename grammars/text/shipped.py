"""Where the campaigns, robots and systems under test that ship with the project lie."""

from __future__ import annotations

from pathlib import Path


def shipped_folder() -> Path:
    """Return the folder of everything that ships for campaigns: data only, nothing is imported."""
    # The packages of the project lie beside each other, in a checkout and installed.
    return Path(__file__).resolve().parents[2] / "campaigns"
