"""YAML files that people write: strict YAML 1.2, every value with its place in the file.

Duplicate keys, tags, anchors that expand without end and unreadable files are reported with line
and column. :func:`read_model` checks a document against a pydantic model and turns each finding
into a diagnostic where the offending value stands.
"""

from __future__ import annotations

import re
import types
import typing
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, TypeAlias, TypeVar

from pydantic import (
    BaseModel,
    ConfigDict,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ValidationError,
)
from pydantic_core import PydanticCustomError, core_schema

from grammars.text.diagnostics import Diagnostic, InputError, Where, closest, did_you_mean
from grammars.text.quantity import read_as

Key: TypeAlias = str | int
KeyPath: TypeAlias = tuple[Key, ...]
M = TypeVar("M", bound="StrictModel")

MAX_BYTES: Final = 8 * 1024 * 1024
"""A file written by a person is never larger than this; a larger one is refused."""
_DEEPEST: Final = 50
"""Levels of nesting: reading recurses, and nobody follows a file that deep."""
_LARGEST: Final = 2**64
"""Whole numbers from here on fit no 64 bits, neither in a ledger nor in what reads our JSON."""


class StrictModel(BaseModel):
    """Base of models of what people write: unknown keys are errors, values are frozen.

    Messages show the first of a field's ``examples`` to whoever left it out or gave it another
    form.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    elsewhere: ClassVar[Mapping[str, str]] = {}
    """Keys that people look for here although they belong somewhere else: what to do instead.
    That of the empty key is said of keys that are like no other."""


@dataclass(frozen=True)
class QuantityField:
    """Marks a field that reads a quantity of ``dimension`` into its SI value.

    With ``plain``, a number without a unit is taken as SI. The JSON schema carries the mark as
    ``quantity``, for whoever tells editors what may be written.
    """

    dimension: str
    plain: bool = False

    def read(self, value: Any) -> float:
        """Return the SI value; raises ``ValueError``."""
        number = isinstance(value, int | float) and not isinstance(value, bool)
        return float(value) if self.plain and number else read_as(value, self.dimension)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> Any:
        return core_schema.no_info_before_validator_function(self.read, handler(source))

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> Any:
        return handler(schema) | {"quantity": {"dimension": self.dimension, "plain": self.plain}}


Length: TypeAlias = Annotated[float, QuantityField("length")]
Angle: TypeAlias = Annotated[float, QuantityField("angle")]
Duration: TypeAlias = Annotated[float, QuantityField("time")]
Mass: TypeAlias = Annotated[float, QuantityField("mass")]
Frequency: TypeAlias = Annotated[float, QuantityField("frequency")]
Speed: TypeAlias = Annotated[float, QuantityField("speed")]
AngularSpeed: TypeAlias = Annotated[float, QuantityField("angular speed")]
Acceleration: TypeAlias = Annotated[float, QuantityField("acceleration")]
AngularAcceleration: TypeAlias = Annotated[float, QuantityField("angular acceleration")]
Force: TypeAlias = Annotated[float, QuantityField("force")]
Torque: TypeAlias = Annotated[float, QuantityField("torque")]
Ratio: TypeAlias = Annotated[float, QuantityField("ratio")]


@dataclass(frozen=True)
class YamlDocument:
    """A parsed file: ``data`` as plain dicts, lists and scalars, ``places`` by key path."""

    file: str
    data: Any
    places: Mapping[KeyPath, Where]
    text: str

    def where(self, path: KeyPath = ()) -> Where:
        """Return the place of the value at ``path``, or of its closest enclosing value."""
        for length in range(len(path), -1, -1):
            place = self.places.get(path[:length])
            if place is not None:
                return place
        return Where(self.file)


def paths_inside(value: Any) -> Iterator[KeyPath]:
    """Yield the ways to everything inside of a list, a mapping, and what is in them."""
    pairs = enumerate(value) if isinstance(value, list) else ()
    for key, below in value.items() if isinstance(value, Mapping) else pairs:
        yield (key,)
        for path in paths_inside(below):
            yield (key, *path)


def read_text(path: str | Path) -> str:
    """Read a text file written by a person; raises :class:`InputError` when that cannot be."""
    file = Path(path)
    try:
        if file.is_dir():
            raise InputError.at(Where(str(path)), "is a folder, expected a file")
        if file.stat().st_size > MAX_BYTES:
            raise InputError.at(Where(str(path)), "is larger than 8 MiB")
        # Editors on Windows begin a file with a byte order mark.
        return file.read_text(encoding="utf-8-sig")
    except FileNotFoundError as error:
        raise InputError.at(Where(str(path)), "no such file", _neighbours(file)) from error
    except UnicodeDecodeError as error:
        raise InputError.at(Where(str(path)), f"is not UTF-8 text (byte {error.start})") from error
    except OSError as error:
        raise InputError.at(Where(str(path)), f"cannot be read: {error.strerror}") from error


def _neighbours(file: Path) -> str:
    folder = file.parent
    if not folder.is_dir():
        return f"there is no folder {folder}"
    return did_you_mean(file.name, (p.name for p in folder.iterdir() if p.is_file()))


def load_yaml(path: str | Path) -> YamlDocument:
    """Read a YAML 1.2 file; raises :class:`InputError` with line and column."""
    return parse_yaml(read_text(path), str(path))


def parse_yaml(text: str, file: str) -> YamlDocument:
    """Parse YAML 1.2 text; ``file`` is the name used in messages."""
    from ruamel.yaml import YAML
    from ruamel.yaml.composer import ComposerError
    from ruamel.yaml.constructor import DuplicateKeyError
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    yaml = YAML(typ="rt")
    yaml.version = (1, 2)
    try:
        # First, by its events alone: aliases of aliases grow without bound once the tree is built.
        _refuse_indirection(text, file)
        tree = yaml.load(text)
    except DuplicateKeyError as error:
        raise InputError(_marked(file, error, "the same key is written twice")) from error
    except (ComposerError, MarkedYAMLError) as error:
        raise InputError(_marked(file, error, "")) from error
    except (YAMLError, ValueError, TypeError, RecursionError) as error:
        first_line = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError.at(Where(file), f"is not valid YAML: {first_line}") from error
    places: dict[KeyPath, Where] = {(): Where(file, 1, 1)}
    data = _plain(tree, (), Where(file), places, text)
    return YamlDocument(file, data, places, text)


def mark_place(file: str, mark: Any) -> Where:
    """Return the place of one of ruamel's marks, which count from 0."""
    return Where(file, mark.line + 1, mark.column + 1) if mark else Where(file)


def _refuse_indirection(text: str, file: str) -> None:
    """Refuse what nobody writes for a person to read: aliases, merges, tags, endless nesting."""
    from ruamel.yaml import YAML
    from ruamel.yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent

    depth = 0
    for event in YAML(typ="safe", pure=True).parse(text):
        depth += isinstance(event, CollectionStartEvent)
        depth -= isinstance(event, CollectionEndEvent)
        where = mark_place(file, event.start_mark)
        if isinstance(event, AliasEvent):
            raise InputError.at(
                where,
                "YAML aliases (*name) are not used here",
                'write it out again; a scenario shares what another says with "like: <scenario>"',
            )
        if getattr(event, "value", None) == "<<" and getattr(event, "style", None) is None:
            raise InputError.at(where, "YAML merge keys (<<) are not used here")
        if getattr(event, "tag", None) is not None:
            raise InputError.at(where, f"YAML tags ({event.tag}) are not used here")
        if depth > _DEEPEST:
            raise InputError.at(where, f"is nested deeper than {_DEEPEST} levels")


# ruamel.yaml tells its errors apart by nothing but their text.
_YAML_REMEDIES: Final = (
    ("'\\t'", "indents with a tab", "indent with spaces"),
    ("found character", "", "put quotes around a value that starts with @ ` % & or *"),
    ("chomping", "a value starts with > or |", "put the value in quotes"),
    (
        "mapping values",
        "has a second colon or is indented too far",
        "put text with a colon in quotes",
    ),
    ("stream end", "ends in the middle of a list or mapping", "a bracket or value is missing"),
)
"""What YAML's own messages mean to a person: part of the message, our words, what to do."""


def _marked(file: str, error: Any, message: str) -> Diagnostic:
    where = mark_place(file, error.problem_mark or error.context_mark)
    problem = str(error.problem or error.context or "is not valid YAML").splitlines()[0]
    for part, ours, hint in _YAML_REMEDIES:
        if part in problem and not message:
            return Diagnostic(where, f"is not valid YAML: {ours or problem}", hint)
    return Diagnostic(where, message or f"is not valid YAML: {problem}")


def _plain(node: Any, path: KeyPath, root: Where, places: dict[KeyPath, Where], text: str) -> Any:
    """Convert ruamel's commented tree to plain data, noting where each value stands."""
    file = root.file
    commented: Any = node
    if isinstance(node, dict):
        result: dict[str, Any] = {}
        for key, value in node.items():
            line, column = commented.lc.key(key)
            where = Where(file, line + 1, column + 1)
            if not isinstance(key, str):
                written, kind = _source(text, where, _KEY) or str(key), _kind(key)
                raise InputError.at(
                    where, f"key {written} is {kind}, not text", f'write it as "{written}"'
                )
            child = (*path, str(key))
            places[child] = where
            result[str(key)] = _plain(value, child, root, places, text)
        return result
    if isinstance(node, list):
        for index in range(len(node)):
            line, column = commented.lc.item(index)
            places[(*path, index)] = Where(file, line + 1, column + 1)
        return [_plain(value, (*path, i), root, places, text) for i, value in enumerate(node)]
    value = _scalar(node)
    if isinstance(value, int) and abs(value) >= _LARGEST:
        raise InputError.at(places.get(path, root), "is a number too large to be meant")
    return value


_KEY: Final = re.compile(r"[^\s:]+")
_VALUE: Final = re.compile(r"(?:[^\s:]+\s*:\s+)?([^\s,\]}#]+)")


def _source(text: str, where: Where, pattern: re.Pattern[str]) -> str:
    """Return what the file says at a place, empty when it is not what the pattern expects."""
    lines = text.splitlines()
    line = lines[where.line - 1] if 0 < where.line <= len(lines) else ""
    found = pattern.match(line, max(0, where.column - 1))
    return "" if found is None else found[found.lastindex or 0]


def _kind(value: Any) -> str:
    """Return what YAML took something for that a person may have meant as text."""
    if isinstance(value, bool):
        return "true or false"
    return "a number" if isinstance(value, int | float) else "empty" if value is None else "a list"


def _scalar(value: Any) -> Any:
    for kind in (bool, int, float, str):
        if isinstance(value, kind):
            return kind(value)
    return value if value is None else str(value)


def read_model(document: YamlDocument, model: type[M]) -> M:
    """Check ``document`` against ``model``; raises :class:`InputError` with every finding."""
    if not isinstance(document.data, dict):
        keys = ", ".join(_names(model))
        raise InputError.at(Where(document.file), f"expected keys such as {keys}")
    try:
        return model.model_validate(document.data)
    except ValidationError as error:
        raise InputError(
            [_explain(document, model, finding) for finding in error.errors()]
        ) from error


def _explain(document: YamlDocument, model: type[BaseModel], finding: Any) -> Diagnostic:
    path, message, hint = explain_finding(model, finding)
    where = document.where(path)
    if finding["type"] == "string_type" and hint:
        # 3.10 has become 3.1 and yes may be true elsewhere: show what was written.
        given = finding["input"]
        written = _source(document.text, where, _VALUE) or str(given)
        hint = _text_hint(written, given)
    return Diagnostic(where, message, hint)


def explain_finding(model: type[BaseModel], finding: Any) -> tuple[KeyPath, str, str]:
    """Return the place, the message and the hint of one of pydantic's errors about ``model``."""
    path = tuple(finding["loc"])
    kind = finding["type"]
    if kind == "extra_forbidden":
        return (path, *_explain_key(_model_at(model, path[:-1]), str(path[-1])))
    if kind == "missing":
        return path[:-1], f'key "{path[-1]}" is missing', _example(model, path)
    given = finding.get("input")
    textless = kind == "string_type" and isinstance(given, bool | int | float)
    hint = _text_hint(str(given), given) if textless else ""
    if kind in _SHAPES:
        hint = _example(model, path)
    words = [str(part) for part in path if isinstance(part, str) and part != "[key]"]
    message = _plain_message(finding)
    return path, f"{words[-1]}: {message}" if words else message, hint


def _explain_key(model: Any, key: str) -> tuple[str, str]:
    """Return message and hint for a key that ``model`` does not have."""
    known, elsewhere = _names(model), getattr(model, "elsewhere", {})
    if key and key in elsewhere:
        renamed = elsewhere[key].startswith("it is called")
        wrong = f'unknown key "{key}"' if renamed else f'key "{key}" is in the wrong place'
        return wrong, elsewhere[key]
    meant = "" if closest(key, known) else closest(key, elsewhere)
    hint = f"{meant}: {elsewhere[meant]}" if meant else did_you_mean(key, known)
    if not meant and not closest(key, known) and elsewhere.get(""):
        hint = f"{elsewhere['']}; {hint}"
    return f'unknown key "{key}"', hint


_WRONG_FORM: Final = "wrong_form"
_SHAPES: Final = ("dict_type", "model_type", "list_type", "too_short", _WRONG_FORM)
"""Findings about the form of a value, which an example answers best."""


def wrong_form(message: str) -> PydanticCustomError:
    """Return what a validator raises for a value of another form than the examples of its field."""
    return PydanticCustomError(_WRONG_FORM, "{message}", {"message": message})


def _example(model: type[BaseModel], path: KeyPath) -> str:
    """Return a line that would do at ``path``, empty when its field has no examples."""
    while path and isinstance(path[-1], int):
        path = path[:-1]
    fields = getattr(_model_at(model, path[:-1]), "model_fields", {})
    for name, field in fields.items():
        if path and (field.alias or name) == path[-1] and field.examples:
            return f"such as: {path[-1]}: {_flow(field.examples[0])}"
    return ""


def _flow(value: Any) -> str:
    """Return a value as YAML has it on one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_flow(part)}" for key, part in value.items()) + "}"
    return f"[{', '.join(map(_flow, value))}]" if isinstance(value, list) else str(value)


def _text_hint(written: str, given: Any) -> str:
    return f'{written} is {_kind(given)}: write it as "{written}"'


_PLAIN_MESSAGES: Final = {
    "string_type": "must be text",
    "int_type": "must be a whole number",
    "int_parsing": "must be a whole number",
    "int_from_float": "must be a whole number",
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
    "list_type": "must be a list",
    "dict_type": "must be keys with values",
    "model_type": "must be keys with values",
    "too_short": "must have {min_length} or more",
    "too_long": "must have {max_length} or fewer",
    "string_too_long": "must have {max_length} characters or fewer",
}
"""What pydantic's findings mean to the person who wrote the file."""


def _plain_message(finding: Any) -> str:
    kind, context = finding["type"], finding.get("ctx", {})
    if kind == "string_pattern_mismatch":
        return _pattern_in_words(context["pattern"])
    if kind in _PLAIN_MESSAGES:
        return _PLAIN_MESSAGES[kind].format(**context)
    message: str = finding["msg"].removeprefix("Value error, ")
    return message.replace("Input should be", "must be", 1)


def _pattern_in_words(pattern: str) -> str:
    """Describe a pattern of names, such as ``^[A-Za-z0-9][A-Za-z0-9._-]{0,59}$``."""
    found = re.fullmatch(r"\^\[A-Za-z0-9\]\[A-Za-z0-9(\.?)_-\](?:\*|\{0,(\d+)\})\$", pattern)
    if found is None:
        return f"must match {pattern}"
    signs = '".", "_" and "-"' if found[1] else '"_" and "-"'
    length = f", {int(found[2]) + 1} at most" if found[2] else ""
    return f"must be letters (a to z), digits, {signs}{length}, and begin with a letter or digit"


def _names(model: Any) -> list[str]:
    fields = getattr(model, "model_fields", {})
    return [field.alias or name for name, field in fields.items()]


def _model_at(model: Any, path: KeyPath) -> Any:
    """Return the model class that describes the mapping at ``path`` (best effort)."""
    current = model
    for part in path:
        fields = getattr(current, "model_fields", None)
        if fields is not None:
            field = fields.get(part) or next((f for f in fields.values() if f.alias == part), None)
            current = _strip(field.annotation) if field is not None else None
        else:
            arguments = typing.get_args(current)
            current = _strip(arguments[-1]) if arguments else None
    return current


def _strip(annotation: Any) -> Any:
    """Drop ``None`` and ``Annotated`` around an annotation; of a union keep the model."""
    if typing.get_origin(annotation) is Annotated:
        return _strip(typing.get_args(annotation)[0])
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        members = [_strip(a) for a in typing.get_args(annotation) if a is not type(None)]
        models = [m for m in members if hasattr(m, "model_fields")]
        return (models or members)[0]
    return annotation
