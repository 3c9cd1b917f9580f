"""Files that make one model: a file, a folder, or several files.

Published models are several ``.json`` files in a folder, linked by their identifiers: a plan is
skeleton, shapes, relations, coordinates and elements, an object has its states and its instances
apart. Naming the folder names the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final, TypeAlias

from grammars.jsonld._expand import expand_text
from grammars.jsonld._legacy_models import settle_models
from grammars.jsonld._legacy_terms import rename_terms
from grammars.jsonld._nodes import NodeGraph
from grammars.jsonld.vocabulary import KC, OBJ, SCN, ST
from grammars.text.diagnostics import Diagnostic, InputError, Where
from grammars.text.sources import is_folder, read_text

ModelPath: TypeAlias = str | Path | Sequence[str | Path]
"""A file, a folder, or several files that make one model."""
_ENDINGS: Final = (".jsonld", ".json")
_OF_OBJECTS: Final = (
    *(OBJ[kind] for kind in ("Object", "ObjectInstance")),
    *(ST[kind] for kind in ("State", "JointState")),
    KC["Joint"],
    SCN["Layer"],
)


def is_jsonld(path: Path) -> bool:
    """Return whether a path is a JSON-LD file by its ending, or a folder that holds some."""
    return bool(_files_in(path)) if is_folder(path) else path.suffix in _ENDINGS


def model_files(path: Path) -> tuple[Path, ...]:
    """Return the files a path names: those of a folder in order, or the file itself."""
    return _files_in(path) if is_folder(path) else (path,)


def path_text(path: ModelPath) -> str:
    """Return what names a model in messages: of several files, the first."""
    return str(path if isinstance(path, str | Path) else path[0])


def plan_nodes(path: ModelPath, base: str = "") -> NodeGraph:
    """Read the files of a floor plan; what a folder says of objects is left out.

    Raises :class:`InputError` with everything that cannot be read; warnings are in
    ``diagnostics``.
    """
    parts = _given(path, base)
    if _is_folder(path):
        parts = [part for part in parts if not _is_of_objects(part)]
    return _merged(parts)


def scenery_nodes(path: ModelPath, base: str = "") -> NodeGraph:
    """Read the files of a scenery layer; what a folder says of a floor plan is left out.

    Raises :class:`InputError` with everything that cannot be read; warnings are in
    ``diagnostics``.
    """
    parts = _given(path, base)
    if _is_folder(path):
        parts = [part for part in parts if _is_of_objects(part)]
    return _merged(parts)


def model_nodes(path: ModelPath, base: str = "") -> NodeGraph:
    """Read the files of whatever it is, a floor plan, a layer or both.

    Raises :class:`InputError` with everything that cannot be read; warnings are in
    ``diagnostics``.
    """
    return _merged(_given(path, base))


def _is_folder(path: ModelPath) -> bool:
    return isinstance(path, str | Path) and is_folder(Path(path))


def _is_of_objects(nodes: NodeGraph) -> bool:
    return any(kind in node.types for node in nodes.by_id.values() for kind in _OF_OBJECTS)


def _files_in(folder: Path) -> tuple[Path, ...]:
    """Return the ``.json`` files of a folder, or, where there are none, the ``.jsonld`` files.

    An export of ours has the same plan both ways.
    """
    for ending in reversed(_ENDINGS):
        found = sorted(file for file in folder.iterdir() if file.suffix == ending)
        if found:
            return tuple(found)
    return ()


def _given(path: ModelPath, base: str) -> list[NodeGraph]:
    """Read every file a path names."""
    if isinstance(path, str | Path):
        files = model_files(Path(path))
    else:
        files = tuple(Path(each) for each in path)
    if not files:
        message = "there is no .json or .jsonld file in this folder"
        raise InputError.at(Where(path_text(path)), message)
    parts: list[NodeGraph] = []
    problems: list[Diagnostic] = []
    for file in files:
        try:
            parts.append(_read(file, base))
        except InputError as error:
            problems.extend(error.diagnostics)
    if problems:
        raise InputError(problems)
    return parts


def _read(file: Path, base: str) -> NodeGraph:
    address = base or file.absolute().as_uri()
    return rename_terms(expand_text(read_text(file), str(file), address))


def _merged(parts: list[NodeGraph]) -> NodeGraph:
    nodes = NodeGraph()
    for part in parts:
        nodes.merge(part)
    settle_models(nodes)
    return nodes
