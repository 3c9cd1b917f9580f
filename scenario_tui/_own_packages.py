"""Import of the project's other packages, whose short names may clash with others.

``daemon``, ``templates``, … may also be files of the working folder, something on ``PYTHONPATH``,
or another project's package (``python-daemon``). Therefore our packages are installed below this
one, and a finder maps their names to that place, before ``sys.path``. In a checkout they lie
beside it. Imports only the standard library.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType
from typing import Final

OWN_PACKAGES: Final = ("grammars", "templates", "daemon", "campaigns")
_HERE: Final = Path(__file__).resolve().parent
_INSTALLED: Final = _HERE / "_import_root"
IMPORT_ROOT: Final = _INSTALLED if _INSTALLED.is_dir() else _HERE.parent
"""The folder of our other packages."""


class OwnPackageFinder:
    """Finds our packages, and leaves all others to other finders.

    A finder needs no base class, and the one of ``importlib.abc`` imports forty modules.
    """

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the place of one of our packages; its modules are found by the usual means."""
        if path is None and fullname in OWN_PACKAGES:
            return PathFinder.find_spec(fullname, [str(IMPORT_ROOT)], target)
        return None


def claim_names() -> None:
    """Make the names of our packages mean ours in this process from now on.

    Raises ``ImportError`` if another package of such a name has been imported already.
    """
    for name in OWN_PACKAGES:
        module = sys.modules.get(name)
        if module is not None and not _is_own(name, module):
            raise ImportError(
                f"{_place(module)} was imported as {name!r} before scenario_tui, which has a "
                f"package of this name: import scenario_tui first, or install it in an environment "
                f"of its own (pipx, venv)",
                name=name,
            )
    if not any(isinstance(finder, OwnPackageFinder) for finder in sys.meta_path):
        sys.meta_path.insert(0, OwnPackageFinder())


def _is_own(name: str, module: ModuleType) -> bool:
    return any(Path(folder).resolve() == IMPORT_ROOT / name for folder in _folders(module))


def _folders(module: ModuleType) -> list[str]:
    return list(getattr(module, "__path__", ()))


def _place(module: ModuleType) -> str:
    return getattr(module, "__file__", None) or next(iter(_folders(module)), repr(module))
