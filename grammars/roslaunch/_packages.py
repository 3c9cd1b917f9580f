"""Packages by name, and the files that launch files name.

A folder with a ``package.xml`` is a package with the name in that file. The search uses neither
ROS_PACKAGE_PATH nor an installed ROS.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

from grammars.text.diagnostics import Finding, InputError, Severity, Where, did_you_mean
from grammars.text.sources import is_folder, names_in, note_read, read_text

_FIND: Final = re.compile(r"\$\(\s*find\s+([^\s()$]+)\s*\)[/\\]?")
_MANIFESTS: Final = ("package.xml", "manifest.xml")
_IGNORED: Final = ("CATKIN_IGNORE", "COLCON_IGNORE")
_DEEPEST: Final = 8
_MOST_FOLDERS: Final = 20_000
_MOST_LINKS: Final = 8


class Packages:
    """Known packages with their folders; of two with the same name the first counts."""

    def __init__(self) -> None:
        self._folders: dict[str, Path] = {}
        self._symbols: dict[Path, str] = {}

    def add(self, folder: Path, where: Where) -> None:
        """Add the package in ``folder``, or all packages below it.

        ``where`` names the folder. Raises :class:`InputError` if there is no package.
        """
        if not folder.is_dir():
            hint = similar_name(folder, folders=True)
            raise InputError.at(where, f"packages: no folder {folder}", hint)
        packages = list(_packages_below(folder))
        if not packages:
            message = f"packages: no package.xml in {folder} or below it"
            raise InputError.at(where, message)
        self._symbols.clear()
        for package in packages:
            self._folders.setdefault(_package_name(package), package)

    def add_around(self, file: Path) -> None:
        """Add the package that contains ``file``, if any."""
        self._symbols.clear()
        for folder in file.absolute().parents:
            if _is_package(folder):
                # As relative as ``file``, so that messages name files as people wrote them.
                way = os.path.relpath(folder, file.parent.absolute())
                self._folders.setdefault(_package_name(folder), _normalised(file.parent / way))
                return

    def symbolic(self, folder: Path) -> str:
        """Return a folder in a package as ``$(find PACKAGE)/…``, any other one as its path.

        Parameters with such folders are then the same on every machine.
        """
        if folder not in self._symbols:
            self._symbols[folder] = self._symbolic(folder)
        return self._symbols[folder]

    def _symbolic(self, folder: Path) -> str:
        absolute = folder.absolute()
        for name, package in self._folders.items():
            top = package.absolute()
            if absolute == top:
                return f"$(find {name})"
            if top in absolute.parents:
                return f"$(find {name})/{absolute.relative_to(top).as_posix()}"
        return str(absolute)

    def path(self, text: str, beside: Path, where: Where) -> Path:
        """Return the path that ``text`` names in a file of the folder ``beside``.

        ``where`` is the place of the text. Raises :class:`PackageError` for an unknown package.
        """
        for match in _FIND.finditer(text):
            if match[1] not in self._folders:
                message = f"package {match[1]} is not given"
                hint = f'name the folder of {match[1]}, or one above it, under "packages"'
                raise PackageError(Finding(where, message, hint))
        start = _FIND.match(text)
        if start is not None:
            return _normalised(self._folders[start[1]] / text[start.end() :].lstrip("/"))
        return beside / text


class PackageError(InputError):
    """A required package is unknown."""


def _normalised(path: Path) -> Path:
    return Path(os.path.normpath(path))


def _is_package(folder: Path) -> bool:
    return any((folder / name).is_file() for name in _MANIFESTS)


def _packages_below(top: Path) -> Iterator[Path]:
    """Yield packages in alphabetical order, without searching inside packages."""
    waiting = [(top, 0)]
    count = 0
    while waiting:
        folder, depth = waiting.pop()
        count += 1
        if _is_package(folder):
            yield folder
        elif depth < _DEEPEST and count < _MOST_FOLDERS:
            below = sorted(_folders_in(folder), reverse=True)
            waiting += [(one, depth + 1) for one in below]


def _folders_in(folder: Path) -> Iterable[Path]:
    try:
        return [
            one
            for one in folder.iterdir()
            if one.is_dir()
            and not one.is_symlink()
            and not one.name.startswith(".")
            and not any((one / name).exists() for name in _IGNORED)
        ]
    except PermissionError:
        # A folder that this user may not read contains no package of theirs.
        return []


def _package_name(folder: Path) -> str:
    """Return the name in the manifest; older packages (manifest.xml) have that of their folder."""
    manifest = folder / _MANIFESTS[0]
    if not manifest.is_file():
        return folder.absolute().name
    # A search suffices: manifests of other packages in a workspace need not be valid.
    text = re.sub(r"<!--.*?-->", "", read_text(manifest), flags=re.DOTALL)
    match = re.search(r"<name>\s*([^<\s]+)\s*</name>", text)
    return match[1] if match else folder.absolute().name


def follow_links(path: Path, warnings: list[Finding]) -> Path:
    """Return the target of ``path`` if it is a symbolic link checked out as text.

    Such a file contains only the name of another file. Archives, and git without support for links,
    write it.
    """
    for _ in range(_MOST_LINKS):
        if not path.is_file() or path.stat().st_size > 300:
            return path
        note_read(path)
        name = path.read_bytes().decode(errors="replace").strip()
        target = path.parent / name
        if not re.fullmatch(r"[\w./-]{1,200}", name) or name == path.name or not target.is_file():
            return path
        message = f"is a symbolic link that became text: {target.name} is read instead"
        note = Finding(Where(str(path), 1, 1), message, "", Severity.WARNING)
        if note not in warnings:
            warnings.append(note)
        path = _normalised(target)
    raise InputError.at(Where(str(path)), "is at the end of too many links in a row")


def is_file(path: Path, where: Where) -> bool:
    """Return whether a file exists; ``where`` names it.

    Raises :class:`InputError` for an invalid file name or an unreadable folder.
    """
    try:
        return path.is_file()
    except OSError as error:
        raise InputError.at(where, f"{str(path)[:200]}: {error.strerror}") from error


def similar_name(path: Path, *, folders: bool = False) -> str:
    """Return a hint with a similar name for a missing file or folder."""
    if not is_folder(path.parent):
        return f"there is no folder {path.parent}"
    names = names_in(path.parent, is_folder) if folders else names_in(path.parent)
    return did_you_mean(path.name, names)
