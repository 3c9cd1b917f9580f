"""Reader of launch files: tag by tag, in the order of the document, as roslaunch does.

It neither runs nor evaluates anything. It opens only included launch files and parameter files.
Source: roslaunch.xmlloader, roslaunch.loader (ROS Noetic).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from grammars.roslaunch._model import LaunchNode, LaunchRemap, LaunchSettings
from grammars.roslaunch._names import (
    ParameterName,
    absolute_name,
    convert_argument,
    is_legal,
    join_names,
    resolve_for_node,
    split_name,
    to_bool,
)
from grammars.roslaunch._packages import PackageError, Packages, follow_links, is_file, similar_name
from grammars.roslaunch._parameters import (
    SOURCES,
    ParameterUpload,
    UnreadParameters,
    read_param,
)
from grammars.roslaunch._substitution import Substitution, UnknownValues, split_words
from grammars.roslaunch._xml import XmlElement, parse_xml
from grammars.text.diagnostics import Finding, InputError, Severity, Where, did_you_mean
from grammars.text.ros_yaml import ParameterValue, parse_ros_yaml
from grammars.text.sources import MAX_BYTES, read_text

_DEEPEST: Final = 30
_MOST_INCLUDES: Final = 1_000
"""More than any robot needs; the limit stops files that include each other twice."""
_IGNORED: Final = frozenset({"env", "machine", "master", "test"})
"""Tags about the execution of processes, without effect on parameters and names."""
_NODE_ATTRIBUTES: Final = (
    "pkg", "type", "name", "ns", "args", "clear_params", "machine", "output", "respawn",
    "respawn_delay", "cwd", "launch-prefix", "required",
)  # fmt: skip
_ATTRIBUTES: Final = {
    "arg": ("name", "value", "default", "doc"),
    "group": ("ns", "clear_params"),
    "include": ("file", "ns", "clear_params", "pass_all_args"),
    "node": _NODE_ATTRIBUTES,
    "param": ("name", "type", *SOURCES),
    "remap": ("from", "to"),
    "rosparam": ("command", "ns", "file", "param", "subst_value"),
}
_CONDITIONS: Final = ("if", "unless")


@dataclass(slots=True)
class Scope:
    """Scope of a launch file, an include or a group; inner scopes begin as copies.

    ``declared`` are the args of this file, true for those that can be passed. ``overriding`` holds
    if the outer file passed on all args: values of this file then replace them. ``outermost`` holds
    in a started file, whose args come from people. ``remaps`` are as written, by source.
    """

    file: Path
    namespace: str = "/"
    args: dict[str, str] = field(default_factory=dict)
    declared: dict[str, bool] = field(default_factory=dict)
    overriding: bool = False
    outermost: bool = False
    remaps: dict[str, LaunchRemap] = field(default_factory=dict)
    private: dict[str, ParameterValue] = field(default_factory=dict)

    def child(self, namespace: str | None) -> Scope:
        """Return a scope inside this one, in its own namespace if any."""
        return Scope(
            file=self.file,
            namespace=join_names(self.namespace, namespace) if namespace else self.namespace,
            args=dict(self.args),
            declared=dict(self.declared),
            outermost=self.outermost,
            remaps=dict(self.remaps),
            private=dict(self.private),
        )

    def declare(self, name: str, value: str | None, default: str | None, where: Where) -> None:
        """Declare an arg; a ``value`` is fixed, a ``default`` holds if no value was passed.

        Raises :class:`InputError` for declarations that roslaunch refuses.
        """
        if name in self.declared and not self.overriding:
            raise InputError.at(where, f"arg {name} is declared twice", "remove one of them")
        # People give args once for all started files, and the arg may be open in another file.
        free = self.overriding or self.outermost
        if value is not None and name in self.args and not free:
            message = f"arg {name} has a fixed value here, but another value was passed"
            raise InputError.at(where, message, "write default instead of value, or pass no value")
        self.declared[name] = value is None
        if value is not None:
            self.args[name] = value
        elif default is not None:
            self.args.setdefault(name, default)

    def start(
        self, node: LaunchNode, arguments: str, where: Where, unknown: UnknownValues
    ) -> LaunchNode:
        """Return ``node`` with its remaps and ``arguments``, which are own_remaps at ``where``.

        Its ``parameters`` are those in its arguments. Raises :class:`InputError` for invalid names.
        """
        try:
            words = split_words(arguments)
        except ValueError as error:
            raise InputError.at(where, f"args: {error}") from error
        own_remaps = [
            (source, LaunchRemap(target, where))
            for source, sign, target in (word.partition(":=") for word in words)
            if sign and source and not source.startswith("_")
        ]
        for source, remap in self.remaps.items():
            for name in (source, remap.to):
                if not is_legal(name) and not unknown.reasons_in(name):
                    raise InputError.at(remap.where, f'"{name}" is not a valid name of ROS')
        # roslaunch appends the remaps to the arguments, and the last remap of a name counts.
        remaps = {
            resolve_for_node(source, node.name): LaunchRemap(
                resolve_for_node(remap.to, node.name), remap.where
            )
            for source, remap in (*own_remaps, *self.remaps.items())
        }
        return replace(
            node,
            arguments=words,
            remaps={source: remap for source, remap in remaps.items() if source != remap.to},
            parameters={
                split_name(name[1:]): ParameterValue(
                    convert_argument(value), where, unknown.reasons_in(value)
                )
                for name, sign, value in (word.partition(":=") for word in words)
                if sign and name.startswith("_") and not name.startswith("__")
            },
        )


@dataclass(slots=True)
class LaunchReader:
    """Reader of launch files, which collects the results in its fields.

    ``notes`` are warnings about parameters, for nodes of interest only. ``declared`` are the args
    of the started files, true for those that can be given.
    """

    settings: LaunchSettings
    packages: Packages
    upload: ParameterUpload = field(default_factory=ParameterUpload)
    unread: list[UnreadParameters] = field(default_factory=list)
    notes: list[UnreadParameters] = field(default_factory=list)
    unknown: UnknownValues = field(default_factory=UnknownValues)
    nodes: dict[str, LaunchNode] = field(default_factory=dict)
    declared: dict[str, bool] = field(default_factory=dict)
    files: dict[str, XmlElement] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    skipped: set[str] = field(default_factory=set)
    errors: list[Finding] = field(default_factory=list)
    warnings: list[Finding] = field(default_factory=list)
    _includes: int = 0
    _started: set[str] = field(default_factory=set)

    def start(self, path: Path) -> None:
        """Read a started launch file, and store its parameters in ``upload``."""
        self.upload = ParameterUpload()
        self._started = set()
        scope = Scope(path, args=dict(self.settings.args), outermost=True)
        try:
            self._children(self._root(path), scope, 0)
        except InputError as error:
            self.errors += error.findings
        for name, is_open in scope.declared.items():
            self.declared[name] = is_open or self.declared.get(name, False)

    def _root(self, path: Path) -> XmlElement:
        """Return the root of a launch file, which is parsed once."""
        path = follow_links(path, self.warnings)
        if str(path) not in self.files:
            root = parse_xml(read_text(path), str(path))
            if root.tag != "launch":
                raise InputError.at(
                    root.where, f"<{root.tag}> is not a launch file, expected <launch>"
                )
            self.files[str(path)] = root
        return self.files[str(path)]

    def _children(self, element: XmlElement, scope: Scope, depth: int) -> None:
        """Read the children of an element; an error in one does not hide another."""
        for child in element.children:
            try:
                self._child(child, scope, depth)
            except InputError as error:
                self.errors += error.findings
                name = child.attributes.get("name")
                if child.tag == "arg" and name:
                    # Every use of the arg fails for the same reason, which is reported once.
                    self.unknown.add(f"$(arg {name})", error.findings)
                    scope.args.setdefault(name, f"$(arg {name})")

    def _child(self, element: XmlElement, scope: Scope, depth: int) -> None:
        if (
            element.tag in _IGNORED
            or not self._is_known(element)
            or not self._applies(element, scope)
        ):
            return
        match element.tag:
            case "arg":
                self._arg(element, scope, scope)
            case "group":
                self._children(element, self._inner(element, scope), depth)
            case "include":
                self._include(element, scope, depth)
            case "node":
                self._node(element, scope)
            case "param":
                self._param(element, scope)
            case "remap":
                self._remap(element, scope, scope)
            case "rosparam":
                self._rosparam(element, scope, scope.namespace, None)

    def _is_known(self, element: XmlElement) -> bool:
        """Return whether roslaunch knows a tag; warn of unknown tags and attributes."""
        if element.tag not in _ATTRIBUTES:
            hint = did_you_mean(element.tag, _ATTRIBUTES)
            self._warn(element.where, f"roslaunch has no tag <{element.tag}>", hint)
            return False
        allowed = (*_ATTRIBUTES[element.tag], *_CONDITIONS)
        for name in element.attributes:
            if name not in allowed and not (element.tag == "node" and name == "exec"):
                message = f"<{element.tag}> of roslaunch has no attribute {name}"
                self._warn(element.place(name), message, did_you_mean(name, allowed))
        return True

    def _warn(self, where: Where, message: str, hint: str = "") -> None:
        warning = Finding(where, message, hint, Severity.WARNING)
        if warning not in self.warnings:
            self.warnings.append(warning)

    def _substitution(self, scope: Scope) -> Substitution:
        """Return the meaning of commands in a scope."""
        folder = self.packages.symbolic(scope.file.parent)
        return Substitution(scope.args, self.settings.env, folder, self.unknown)

    def _attribute(self, element: XmlElement, name: str, scope: Scope) -> str | None:
        """Return an attribute with its commands replaced, or ``None`` if it does not exist."""
        text = element.attributes.get(name)
        if text is None:
            return None
        return self._substitution(scope).fill_in(text, element.place(name))

    def _required(self, element: XmlElement, name: str, scope: Scope) -> str:
        """Return a required attribute; raises :class:`InputError` if it does not exist."""
        text = self._attribute(element, name, scope)
        if text is None:
            raise InputError.at(element.where, f"<{element.tag}> needs the attribute {name}")
        return text

    def _switch(self, element: XmlElement, name: str, scope: Scope) -> bool:
        """Return whether an attribute is true; raises :class:`InputError`."""
        text = self._attribute(element, name, scope)
        if text is None:
            return False
        self.unknown.refuse_in(text)
        try:
            return to_bool(text)
        except ValueError as error:
            message = f"{name}: {error}"
            raise InputError.at(element.place(name), message, "write true or false") from error

    def _applies(self, element: XmlElement, scope: Scope) -> bool:
        """Return whether an element applies, by its ``if`` or ``unless``."""
        names = [name for name in _CONDITIONS if name in element.attributes]
        if len(names) > 1:
            raise InputError.at(element.where, "has both if and unless", "write one of them")
        return all(self._switch(element, name, scope) is (name == "if") for name in names)

    def _inner(self, element: XmlElement, scope: Scope) -> Scope:
        """Return the scope inside a group, include or node; clear its namespace if it says so."""
        namespace = self._attribute(element, "ns", scope)
        if namespace == "":
            raise InputError.at(element.place("ns"), "ns is empty", "leave it out, or write a name")
        inner = scope.child(namespace)
        if element.tag != "node" and self._switch(element, "clear_params", scope):
            if namespace is None:
                raise InputError.at(element.place("clear_params"), "clear_params needs ns")
            self.upload.cleared.append(split_name(inner.namespace))
        return inner

    def _arg(self, element: XmlElement, scope: Scope, target: Scope) -> None:
        """Declare an arg in ``target`` with a value evaluated in ``scope``."""
        name = self._required(element, "name", scope)
        value = self._attribute(element, "value", scope)
        default = self._attribute(element, "default", scope)
        if value is not None and default is not None:
            message = f"arg {name} has a value and a default"
            raise InputError.at(element.where, message, "write one of them")
        if default is not None and target.outermost:
            self.unknown.add_remedy(default, f'give the arg {name} under "args"')
        target.declare(name, value, default, element.where)

    def _param(self, element: XmlElement, scope: Scope, *, private: bool = False) -> None:
        """Set a parameter; a private one is stored for later nodes of the scope."""
        sources = [name for name in SOURCES if name in element.attributes]
        if len(sources) != 1:
            message = f"<param> has {' and '.join(sources) or 'no value'}"
            raise InputError.at(element.where, message, f"write one of {', '.join(SOURCES)}")
        name = self._required(element, "name", scope).strip()
        text = self._required(element, sources[0], scope)
        parameter = read_param(element, sources[0], text, self.unknown)
        if private or name.startswith("~"):
            scope.private[name.removeprefix("~")] = parameter
        else:
            self.upload.set(split_name(join_names(scope.namespace, name)), parameter)

    def _remap(self, element: XmlElement, scope: Scope, target: Scope) -> None:
        source = self._required(element, "from", scope)
        to = self._required(element, "to", scope)
        if not source or not to:
            raise InputError.at(element.where, "<remap> from and to must not be empty")
        # This remap replaces one of the same name further out.
        target.remaps.pop(source, None)
        target.remaps[source] = LaunchRemap(to, element.where)

    def _include(self, element: XmlElement, scope: Scope, depth: int) -> None:
        file = self._required(element, "file", scope)
        if self._is_skipped(file):
            return
        where = element.place("file")
        try:
            path = self.packages.path(file, scope.file.parent, where)
        except PackageError as error:
            self._leave_out(file, error.findings[0])
            return
        self.unknown.refuse_in(file)
        if not is_file(path, where):
            raise InputError.at(where, f"no file {path} to include", _remedies(path))
        self._includes += 1
        if depth >= _DEEPEST or self._includes > _MOST_INCLUDES:
            raise InputError.at(where, f"includes of {path.name} are nested without end")
        inner = self._inner(element, scope)
        everything = self._switch(element, "pass_all_args", scope)
        passed = Scope(
            inner.file, args=dict(scope.args) if everything else {}, overriding=everything
        )
        for child in element.children:
            if child.tag == "arg" and self._applies(child, scope):
                self._arg(child, scope, passed)
        for name in passed.declared:
            if name not in passed.args:
                raise InputError.at(element.where, f"arg {name} is passed without a value")
        inner.file, inner.args, inner.declared = path, passed.args, {}
        inner.overriding, inner.outermost = everything, False
        self._children(self._root(path), inner, depth + 1)
        if not everything:
            self._refuse_unused(element, passed.declared, inner, path)

    def _refuse_unused(
        self, element: XmlElement, passed: Iterable[str], inner: Scope, path: Path
    ) -> None:
        """Report args that the included file does not declare, as roslaunch does."""
        places = {c.attributes.get("name"): c.place("name") for c in element.children}
        for name in passed:
            if name not in inner.declared:
                message = f"{path.name} has no arg {name}, roslaunch refuses to start this"
                hint = did_you_mean(name, inner.declared)
                self.errors.append(Finding(places.get(name, element.where), message, hint))

    def _leave_out(self, file: str, reason: Finding) -> None:
        self.left_out.append(file)
        hint = f'{reason.hint}, or the file under "skip" if you do not need it'
        self._warn(reason.where, f"{reason.message}: {file} is ignored", hint)

    def _is_skipped(self, file: str) -> bool:
        endings = [ending for ending in self.settings.skip if file.endswith(ending)]
        self.skipped.update(endings)
        return bool(endings)

    def _node(self, element: XmlElement, scope: Scope) -> None:
        if "exec" in element.attributes and "type" not in element.attributes:
            message = "<node exec=…> is for ROS 2, but this is a launch file of ROS 1"
            raise InputError.at(element.where, message, 'test a ROS 2 stack with "kind: ros2"')
        name = self._required(element, "name", scope)
        inner = self._inner(element, scope)
        full = split_name(join_names(inner.namespace, name))
        if "/" in name:
            message = f'name "{name}" of a node cannot contain a namespace'
            raise InputError.at(element.place("name"), message, "write the namespace as ns")
        if self._switch(element, "clear_params", scope):
            self.upload.cleared.append(full)
        own = replace(inner, private={}, remaps=dict(scope.remaps))
        for child in element.children:
            if child.tag in _IGNORED or not self._is_known(child) or not self._applies(child, own):
                continue
            if child.tag == "remap":
                self._remap(child, scope, own)
            elif child.tag == "param":
                self._param(child, own, private=True)
            elif child.tag == "rosparam":
                self._rosparam(child, own, absolute_name(full), full)
        # roslaunch sets a node's <param>s after its <rosparam>s, in any order of the tags.
        for key, parameter in (*scope.private.items(), *own.private.items()):
            self.upload.set((*full, *split_name(key)), parameter)
        package, kind = (self._required(element, key, scope) for key in ("pkg", "type"))
        arguments = self._attribute(element, "args", scope) or ""
        node = LaunchNode(absolute_name(full), package, kind, (), element.where)
        node = own.start(node, arguments, element.place("args"), self.unknown)
        if node.name in self._started:
            message = f"a second node is called {node.name}, roslaunch refuses to start this"
            raise InputError.at(element.where, message, "give one of them another name or ns")
        self._started.add(node.name)
        self.nodes[node.name] = node

    def _rosparam(
        self, element: XmlElement, scope: Scope, namespace: str, owner: ParameterName | None
    ) -> None:
        """Load parameters into ``namespace``; ``owner`` is the node around the tag, if any."""
        command = self._attribute(element, "command", scope) or "load"
        ns, param = (self._attribute(element, key, scope) for key in ("ns", "param"))
        below = join_names(ns or "", param or "")
        target = split_name(join_names(namespace, below))
        if command == "delete":
            self.upload.cleared.append(target)
        elif command == "load":
            try:
                self._load(element, scope, target, owner, any_value=bool(below))
            except InputError as error:
                self.unread.append(UnreadParameters(target, owner, error.findings))
        elif command != "dump":
            message = f'unknown command "{command}"'
            raise InputError.at(element.place("command"), message, "write load, delete or dump")

    def _load(
        self,
        element: XmlElement,
        scope: Scope,
        target: ParameterName,
        owner: ParameterName | None,
        *,
        any_value: bool,
    ) -> None:
        """Load the parameters in a file or in the element itself; raises :class:`InputError`."""
        lines = element.lines
        source, name = element.text, element.where.file
        file = self._attribute(element, "file", scope)
        if file is not None:
            if self._is_skipped(file):
                return
            path = self._parameter_file(file, scope, element.place("file"))
            source, name, lines = read_text(path), str(path), ()
        source_lines = source.split("\n")

        def locate(line: int, column: int) -> Where:
            if file is not None:
                # A text with replaced commands may be longer than its line.
                original = source_lines[line - 1] if line <= len(source_lines) else ""
                return Where(name, line, min(column, len(original) + 1))
            if line > len(lines):  # The end of the text, at the start of an empty line.
                last = lines[-1] if lines else element.where
                return Where(name, last.line + line - len(lines), column)
            begin = lines[line - 1]
            return Where(name, begin.line, begin.column + column - 1)

        if self._switch(element, "subst_value", scope):
            substitution = self._substitution(scope)
            source = ""
            for number, line in enumerate(source_lines, 1):
                source += substitution.fill_in(line, locate(number, 1)) + "\n"
                if len(source) > MAX_BYTES:
                    message = f"is larger than {MAX_BYTES >> 20} MiB with its commands replaced"
                    raise InputError.at(locate(number, 1), message)
        document, notes = parse_ros_yaml(source, name, locate=locate, any_value=any_value)
        self.notes.append(UnreadParameters(target, owner, notes))
        self.upload.load(target, document, self.unknown)

    def _parameter_file(self, file: str, scope: Scope, where: Where) -> Path:
        ending = file.rpartition("/")[2]
        if "$(" not in ending:
            remedy = f'if the node starts without the file, write "{ending}" under "skip"'
            self.unknown.add_remedy(file, remedy)
        self.unknown.refuse_in(file)
        path = self.packages.path(file, scope.file.parent, where)
        if not is_file(path, where):
            raise InputError.at(where, f"no file {path}", _remedies(path))
        return follow_links(path, self.warnings)


def _remedies(path: Path) -> str:
    """Return a hint about a missing file."""
    skip = f'if it is not needed, write "{path.name}" under "skip"'
    return "; ".join(filter(None, (similar_name(path), skip)))
