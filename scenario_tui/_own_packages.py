"""Our other packages have short names: whoever else has one of them, here it means ours.

``daemon``, ``templates``, … may also be files of the folder somebody works in, something on
``PYTHONPATH``, or another project's package (``python-daemon``). Installed, ours therefore lie
below this package, where nobody else's files are, and are found by name whatever the modules' path
says. In a checkout they lie beside it. Imports nothing but the standard library.
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
"""The folder our other packages lie in."""


class OwnPackageFinder:
    """Finds our packages, and leaves everything else to others.

    A finder needs no base class; that of ``importlib.abc`` imports forty modules.
    """

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return where one of our packages is; its modules are found by the usual means."""
        if path is None and fullname in OWN_PACKAGES:
            return PathFinder.find_spec(fullname, [str(IMPORT_ROOT)], target)
        return None


def claim_names() -> None:
    """Have the names of our packages mean ours in this process from now on.

    Raises ``ImportError`` when one of them has been imported as something else already.
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
