"""Systems under test as they run: values of all files, with overrides, checked."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

from daemon.campaign._parameter_files import (
    ParameterPath,
    ParameterValues,
    apply_common_costmap,
    parameter_place,
    parameter_tree,
)
from daemon.campaign._sut_files import SutLayer
from daemon.model.attachments import attach_files
from daemon.model.spec import SutReference
from daemon.stacks.findings import ParameterError, ParameterFinding, ParameterFindings
from grammars.text.diagnostics import Finding, InputError, Severity, Where
from grammars.text.documents import YamlDocument
from grammars.text.overrides import Override, split_key
from grammars.text.quantity import read_quantity
from grammars.text.ros_yaml import ParameterValue

_MOST_NAMED: Final = 6
"""Most parameters without effect that a warning names."""


@dataclass(frozen=True, slots=True)
class LoadedSut:
    """A loaded system under test, with the place of each value and all findings.

    ``layer`` is the content of its files, ``settings`` are its values with those of the campaign.
    ``idle`` is the warning about values without effect, the last of the ``warnings``, if any.
    """

    reference: SutReference
    layer: SutLayer
    settings: ParameterValues
    findings: ParameterFindings
    warnings: tuple[Finding, ...]
    idle: tuple[Finding, ...] = ()


class RefusedSutError(InputError):
    """A system under test that cannot run; ``settings`` are the values it would have."""

    def __init__(self, diagnostics: list[Finding], settings: ParameterValues) -> None:
        super().__init__(diagnostics)
        self.settings = settings


def complete_sut(layer: SutLayer, overrides: Sequence[Override] = ()) -> LoadedSut:
    """Return the system under test of files, with other values for some parameters.

    Raises :class:`InputError` with all errors, each with its place.
    """
    if overrides:
        layer = layer.changed(_changes(overrides, layer))
    kind, document, settings = layer.kind, layer.document, layer.settings
    if kind.files == "parameters":
        settings = apply_common_costmap(settings)
    _refuse_missing(settings)
    tree = parameter_tree(settings)
    if kind.external:
        tree.setdefault("repeatable", False)
    reference = SutReference(layer.text.sut, kind.name, tree, _attach(layer))
    try:
        findings = kind.findings(kind.read(reference.local_parameters))
    except ValueError as error:
        if isinstance(error, ParameterError):
            # An unused file leaves the defaults in place, which may cause unrelated errors.
            _refuse_unread(settings, error.findings, layer.parameter_files)
        raise RefusedSutError(_diagnostics(error, document, settings), settings) from error
    _refuse_unread(settings, findings, layer.parameter_files)
    place = partial(_placed, document=document, settings=settings, severity=Severity.WARNING)
    warnings = dict.fromkeys(map(place, findings.problems))
    idle = _idle_warning(findings, layer, settings)
    return LoadedSut(
        reference, layer, settings, findings, (*layer.warnings, *warnings, *idle), idle
    )


def _refuse_missing(settings: ParameterValues) -> None:
    """Refuse values that launch files could not resolve and no SUT file replaces."""
    missing = [
        replace(lack, message=f"{lack.message}; {'/'.join(path)} has no value without it")
        for path, setting in settings.items()
        for lack in setting.missing
    ]
    if missing:
        raise InputError(missing)


def _attach(layer: SutLayer) -> dict[str, str]:
    where = layer.document.where(("files",))
    try:
        return attach_files(layer.attached)
    except ValueError as error:
        raise InputError(Finding(where, str(error))) from error
    except OSError as error:
        message = f"files: {error.filename} cannot be read: {error.strerror}"
        raise InputError(Finding(where, message)) from error


def _refuse_unread(
    settings: ParameterValues, findings: ParameterFindings, files: Iterable[str]
) -> None:
    """Raise :class:`InputError` for ``files`` without a single used parameter."""
    unread = {finding.path for finding in findings.problems if finding.unread}
    problems = []
    for file in files:
        own = {path: s for path, s in settings.items() if s.where.file == file}
        if own and all(any(path[:n] in unread for n in range(1, len(path) + 1)) for path in own):
            first, setting = next(iter(own.items()))
            message = f"no value of this file is read: {'/'.join(first)} is not a parameter here"
            problems.append(Finding(setting.where, message, _remedy(own)))
    if problems:
        raise InputError(problems)


_SECTIONS: Final = ("amcl", "move_base")


def _remedy(paths: Iterable[ParameterPath]) -> str:
    """Return a remedy for a file that has the parameters of a node below another name."""
    for path in paths:
        for node in _SECTIONS:
            if node in path[1:-1]:
                index = max(i for i, part in enumerate(path[:-1]) if part == node)
                extra, name = "/".join(path[:index]), "/".join(path[index:])
                return (
                    f"write {name}: remove {extra} from the file or from its namespace "
                    '("/" for the root)'
                )
    return "load it into the namespace of the node that reads it, see files"


_OF_FILES: Final = frozenset(("sut", "about", "like", "kind", "ros", "files", "parameters"))


def _changes(overrides: Sequence[Override], layer: SutLayer) -> ParameterValues:
    """Return overrides as parameters of a layer: dots and slashes lead into namespaces."""
    settings = layer.settings
    changes: ParameterValues = {}
    for override in overrides:
        path = _parameter_path(override.key, settings)
        if path[0] in _OF_FILES and not any(other[0] == path[0] for other in settings):
            message = f'"{path[0]}" is not a parameter'
            hint = "write a file of its own: suts/NAME.yaml with like: this one"
            if path[0] == "parameters" and len(path) > 1:
                hint = f"write {'.'.join(path[1:])} alone"
            raise InputError.at(override.where, message, hint)
        before = settings.get(path)
        value = override.value
        if layer.kind.plain_numbers and not (before and isinstance(before.value, str)):
            value = _plain(value)
        changes[path] = ParameterValue(value, override.where)
    return changes


def _parameter_path(key: str, settings: ParameterValues) -> ParameterPath:
    """Return the path of a dotted or slashed key; existing names may contain dots."""
    paths, rest = list(settings), key.strip("/")
    path: ParameterPath = ()
    while rest:
        names = dict.fromkeys(p[len(path)] for p in paths if len(p) > len(path))
        name, rest = split_key(names, rest, "./")
        path = (*path, name)
        paths = [p for p in paths if p[: len(path)] == path]
    return path or (key,)


_QUANTITY: Final = re.compile(r"\s*[+-]?(?:\d|\.\d)")


def _plain(value: Any) -> Any:
    """Return a quantity with a unit as a number in SI units; keep any other value."""
    if not isinstance(value, str) or not _QUANTITY.match(value):
        return value
    try:
        return read_quantity(value).value
    except ValueError:
        return value  # text that begins with a digit, which the kind checks


def _diagnostics(
    error: ValueError, document: YamlDocument, settings: ParameterValues
) -> list[Finding]:
    """Return the findings of an error, each at the place of its value."""
    if isinstance(error, ParameterError):
        place = partial(_placed, document=document, settings=settings)
        return list(dict.fromkeys(map(place, error.problems)))
    # A plain ValueError has no path: the best guess is the first parameter that it names.
    message = str(error)
    where = _named_place(message, settings)
    if where is not None:
        return [Finding(where, message)]
    key = next((key for key in ("parameters", "kind", "like") if key in document.data), "sut")
    return [Finding(document.where((key,)), message)]


def _named_place(message: str, settings: ParameterValues) -> Where | None:
    """Return the place of the first parameter that a message names."""
    for path, setting in settings.items():
        if f'"{path[0]}"' in message or message.startswith(f"{path[0]}:"):
            return setting.where
    return None


def _idle_warning(
    findings: ParameterFindings, layer: SutLayer, settings: ParameterValues
) -> tuple[Finding, ...]:
    """Return the warning that names values without effect, if any."""
    # A common value of both costmaps is one line of a file, so it is named once.
    idle = {
        parameter_place(settings, finding.path): "/".join(map(str, finding.path[-2:]))
        for finding in findings.without_effect
    }
    if not idle:
        return ()
    names = list(idle.values())
    more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
    message = f"without effect here: {', '.join(names[:_MOST_NAMED])}{more}"
    hint = f"scenario sut show {shlex.quote(layer.document.file)} says why" if layer.files else ""
    return (Finding(layer.document.where(("sut",)), message, hint, Severity.WARNING),)


def _placed(
    finding: ParameterFinding,
    document: YamlDocument,
    settings: ParameterValues,
    severity: Severity = Severity.ERROR,
) -> Finding:
    where = parameter_place(settings, finding.path)
    if where is None:
        # The path is of a key that is not a parameter, such as a file's name.
        is_key = finding.path and finding.path[0] in document.data
        where = document.where(finding.path if is_key else ("sut",))
    return Finding(where, _named(finding), finding.hint, severity)


def _named(finding: ParameterFinding) -> str:
    """Return the message with the name of its value in front, unless it contains it."""
    names = [part for part in finding.path if isinstance(part, str)]
    name = names[-1] if names else ""
    if not name or finding.message.startswith(name) or f'"{name}"' in finding.message:
        return finding.message
    indices = "".join(f"[{part}]" for part in finding.path if isinstance(part, int))
    return f"{name}{indices}: {finding.message}"
