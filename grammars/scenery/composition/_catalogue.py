"""Names across layers, and the targets of sentences."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Final, TypeVar

from grammars.model.scene import Joint
from grammars.scenery.model import Group, Instance, ObjectModel, Path, SceneryLayer, Subject
from grammars.text.diagnostics import (
    Finding,
    Findings,
    InputError,
    Severity,
    did_you_mean,
)

Named = TypeVar("Named", ObjectModel, Instance)
_WARNING: Final = Severity.WARNING


class Catalogue:
    """Models, instances and groups of several layers; raises for duplicate names."""

    def __init__(self, layers: Sequence[SceneryLayer]) -> None:
        findings = Findings()
        self._layers = layers
        self._expanded: dict[int, tuple[Path, ...]] = {}
        self.models = _index((m for layer in layers for m in layer.models), "object", findings)
        instances = (i for layer in layers for i in layer.instances)
        self.instances = _index(instances, "object", findings)
        for name, instance in self.instances.items():
            if instance.model.text not in self.models:
                hint = did_you_mean(instance.model.text, self.models)
                message = f'{name}: there is no object model "{instance.model.text}"'
                findings.error(instance.model.where, message, hint)
        findings.raise_errors()

    def model_of(self, name: str) -> ObjectModel:
        """Return the model of the instance ``name``."""
        return self.models[self.instances[name].model.text]

    def joints(self) -> Iterator[tuple[Joint, ...]]:
        """Yield the joints of every instance."""
        return (self.model_of(name).joints for name in self.instances)

    def targets(
        self, layer: SceneryLayer, subject: Subject, trail: tuple[str, ...] = ()
    ) -> tuple[Path, ...]:
        """Return the objects or joints that ``subject`` means in ``layer``, each once, in order.

        ``trail`` has the names of the groups around it. Raises :class:`InputError` for unknown
        names, with the closest known one.
        """
        excluded = {
            target.object
            for path in subject.exceptions
            for target in (
                (self._one(layer, path),)
                if path.object in self.instances
                else self._many(layer, path, trail)
            )
        }
        targets = [
            target
            for path in subject.names
            for target in (
                self._many(layer, path, trail) if subject.every else (self._one(layer, path),)
            )
            if target.object not in excluded
        ]
        return tuple(dict.fromkeys(targets))

    def unknown_members(self) -> list[Finding]:
        """Return a warning for every group with unknown members, and every sentence without any."""
        findings: list[Finding] = []
        for layer in self._layers:
            for sentence in (*layer.settings, *layer.sentences):
                if not self.targets(layer, sentence.subject):
                    rest = " after except" if sentence.subject.exceptions else ""
                    message = f"{sentence.subject}: there is none{rest}"
                    hint = "name other objects, or leave the sentence out"
                    findings.append(Finding(sentence.where, message, hint, _WARNING))
            for group in layer.groups:
                try:
                    self.targets(layer, group.members)
                except InputError as error:
                    findings += [
                        replace(d, message=f"group {group.name}: {d.message}", severity=_WARNING)
                        for d in error.findings
                    ]
        return findings

    def _one(self, layer: SceneryLayer, path: Path) -> Path:
        instance = self.instances.get(path.object)
        if instance is not None:
            self._check_joint(path, (path.object,))
            return path
        if path.object in self.models or self._groups(layer, path.object):
            kind = "an object model" if path.object in self.models else "a group"
            raise InputError.at(
                path.where, f'"{path.object}" is {kind}', f"write every {path.object}"
            )
        hint = did_you_mean(path.object, self.instances)
        raise InputError.at(path.where, f'there is no object "{path.object}"', hint)

    def _many(self, layer: SceneryLayer, path: Path, trail: tuple[str, ...]) -> tuple[Path, ...]:
        groups = self._groups(layer, path.object)
        if groups:
            return self._members(path, groups, trail)
        if path.object in self.models:
            names = tuple(n for n, i in self.instances.items() if i.model.text == path.object)
            self._check_joint(path, names)
            return tuple(replace(path, object=name) for name in names)
        if path.object in self.instances:
            message = f'"{path.object}" is a single object'
            raise InputError.at(path.where, message, 'remove "every"')
        names = (*self.models, *(g.name for other in self._layers for g in other.groups))
        hint = did_you_mean(path.object, names)
        message = f'there is no group or object model "{path.object}"'
        raise InputError.at(path.where, message, hint)

    def _members(
        self, path: Path, groups: list[tuple[SceneryLayer, Group]], trail: tuple[str, ...]
    ) -> tuple[Path, ...]:
        home, group = groups[0]
        if len(groups) > 1:
            places = " and ".join(str(g.where) for _, g in groups)
            raise InputError.at(path.where, f'"{path.object}" may mean several groups', places)
        if group.name in trail:
            raise InputError.at(group.where, f'group "{group.name}" contains itself')
        # Expand each group once: nested groups would double the time with every level.
        if id(group) not in self._expanded:
            targets = self.targets(home, group.members, (*trail, group.name))
            self._expanded[id(group)] = targets
        members = self._expanded[id(group)]
        if not path.joint:
            return members
        self._check_joint(path, [t.object for t in members])
        return tuple(replace(target, joint=path.joint) for target in members)

    def _groups(self, layer: SceneryLayer, name: str) -> list[tuple[SceneryLayer, Group]]:
        # A group of the layer hides groups of other layers.
        own = [(layer, g) for g in layer.groups if g.name == name]
        return own or [(other, g) for other in self._layers for g in other.groups if g.name == name]

    def _check_joint(self, path: Path, objects: Iterable[str]) -> None:
        for name in objects if path.joint else ():
            joints = [joint.name for joint in self.model_of(name).joints]
            if path.joint not in joints:
                hint = did_you_mean(path.joint, joints)
                message = f'{name} has no joint "{path.joint}"'
                raise InputError.at(path.where, message, hint)


def _index(items: Iterable[Named], kind: str, findings: Findings) -> dict[str, Named]:
    index: dict[str, Named] = {}
    for item in items:
        if item.name in index:
            message = f'two {kind}s have the name "{item.name}"'
            findings.error(item.where, message, f"the other one: {index[item.name].where}")
        index.setdefault(item.name, item)
    return index
