"""Which files make one model: a file, a folder, or one file and what it needs beside it.

Published models are several ``.json`` files in a folder, linked by their identifiers: a plan is
skeleton, shapes, relations, coordinates and elements, an object has its states and its instances
apart. Naming the folder, or any of its files, names the model.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final, TypeAlias

from grammars.jsonld._expand import expand_text
from grammars.jsonld._legacy_models import settle_models
from grammars.jsonld._legacy_terms import rename_terms
from grammars.jsonld._nodes import NodeGraph
from grammars.jsonld._references import dangling
from grammars.jsonld.vocabulary import FP, KC, OBJ, SCN, ST
from grammars.text.diagnostics import Diagnostic, InputError, Severity, Where
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
    elif _may_lack_parts(path) and _lacks_parts(parts[0]):
        own = bool(parts[0].of_type(FP["FloorPlan"]))
        parts += [
            part
            for part in _beside(path, parts[0], base)
            # Several plans in one folder are told apart by the one that was named.
            if not _is_of_objects(part) and not (own and part.of_type(FP["FloorPlan"]))
        ]
    return _merged(parts)


def scenery_nodes(path: ModelPath, base: str = "") -> NodeGraph:
    """Read the files of a scenery layer; what a folder says of a floor plan is left out.

    Raises :class:`InputError` with everything that cannot be read; warnings are in
    ``diagnostics``.
    """
    parts = _given(path, base)
    if _is_folder(path):
        parts = [part for part in parts if _is_of_objects(part)]
    elif _may_lack_parts(path):
        # Read when something is missing; states refer to their object and not the other way.
        parts += _completion(parts[0], _beside(path, parts[0], base), path_text(path))
    return _merged(parts)


def model_nodes(path: ModelPath, base: str = "") -> NodeGraph:
    """Read the files of whatever it is, a floor plan, a layer or both.

    Raises :class:`InputError` with everything that cannot be read; warnings are in
    ``diagnostics``.
    """
    if _is_folder(path) or not _may_lack_parts(path):
        return _merged(_given(path, base))
    (part,) = _given(path, base)
    return scenery_nodes(path, base) if _is_of_objects(part) else plan_nodes(path, base)


def _is_folder(path: ModelPath) -> bool:
    return isinstance(path, str | Path) and is_folder(Path(path))


def _may_lack_parts(path: ModelPath) -> bool:
    """Return whether a model may go on in other files: ours, ``.jsonld``, are each complete."""
    return isinstance(path, str | Path) and Path(path).suffix == ".json"


def _lacks_parts(nodes: NodeGraph) -> bool:
    return not nodes.of_type(FP["FloorPlan"]) or bool(dangling(nodes))


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


def _beside(path: ModelPath, found: NodeGraph, base: str) -> list[NodeGraph]:
    """Read the other ``.json`` files of a file's folder; one that cannot be read is a warning."""
    own = Path(path_text(path))
    parts: list[NodeGraph] = []
    for file in _files_in(own.absolute().parent):
        if file.name == own.name:
            continue
        file = own.with_name(file.name)
        try:
            parts.append(_read(file, base))
        except InputError as error:
            first = error.diagnostics[0]
            hint = "what it defines is not known here"
            message = f"left out, it cannot be read: {first.message}"
            found.diagnostics.append(Diagnostic(first.where, message, hint, Severity.WARNING))
    return parts


def _completion(own: NodeGraph, others: list[NodeGraph], file: str) -> list[NodeGraph]:
    """Return those of ``others`` that define what is missing, or states of joints that are there.

    Raises :class:`InputError` when two of them define the same thing that is missing.
    """
    left = [other for other in others if _is_of_objects(other)]
    taken: list[NodeGraph] = []
    parts = [own]
    while True:
        have = {id for part in parts for id, node in part.by_id.items() if node.types}
        missing = {target for part in parts for _, _, target in dangling(part)} - have
        joints = {node.id for part in parts for node in part.of_type(KC["Joint"])}
        useful = [
            other
            for other in left
            if any(other.by_id[id].types for id in missing if id in other.by_id)
            or any(
                joints & set(state.refs(ST["joint"])) for state in other.of_type(ST["JointState"])
            )
        ]
        if not useful:
            return taken
        _refuse_rivals(useful, missing, file)
        taken += useful
        parts += useful
        left = [other for other in left if other not in useful]


def _refuse_rivals(useful: list[NodeGraph], missing: Iterable[str], file: str) -> None:
    for id in sorted(missing):
        places = [
            other.where(id) for other in useful if id in other.by_id and other.by_id[id].types
        ]
        if len(places) > 1:
            names = " and ".join(Path(place.file).name for place in places)
            raise InputError.at(
                Where(file),
                f"{id} is defined in {names}",
                "name the files that belong together, or put them into a folder of their own",
            )


def _merged(parts: list[NodeGraph]) -> NodeGraph:
    nodes = NodeGraph()
    for part in parts:
        nodes.merge(part)
    settle_models(nodes)
    return nodes
