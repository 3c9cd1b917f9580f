"""The examples of a page, written into a folder one after the other and checked as files are.

The words behind a fence say what a block is::

    ```fpm house.fpm            a floor plan, kept under that name for the blocks below it
    ```fpm                      more of it: added to the end of the plan above, for this block alone
    ```scenery doors.scenery    a layer, composed with the plan above and the objects above it
    ```scenery                  one more layer, for this block alone
    ```variation                a family of the plan above
    ```yaml campaign demo.yaml  also robot, mission, oracles, sut, walls; without a name, top-level
                                keys (or scenarios, indented) that take the place of those above

An ``error`` or ``warning`` at the end says that it is wrong: the next block, ```text, is what must
be said of it, exactly; with the file's name only where it begins with that. Blocks of other
languages are not looked at.
"""

from __future__ import annotations

import re
import shutil
from dataclasses import dataclass, field
from pathlib import Path

import yaml

from grammars.text.diagnostics import Severity
from scenario_tui.library.checking import check_file
from tests.docs import ebnf, tables
from tests.docs.markdown import ROOT, Block, blocks

KINDS = ("fpm", "scenery", "variation", "campaign", "robot", "mission", "oracles", "sut", "walls")
_LANGUAGES = {"fpm": "floorplan", "scenery": "scenery", "variation": "variation"}
_WHOLE = ("scenery", "variation", "mission", "oracles", "walls")
"""Kinds of which a block is never a part of an earlier one."""


@dataclass(frozen=True, slots=True)
class Example:
    """A block that is executed: its kind, the name it is kept under, what must be said of it.

    ``wrong`` is empty, ``error`` or ``warning``.
    """

    block: Block
    kind: str
    name: str
    wrong: str
    expected: str
    shown: Block | None = None
    """The block that shows what must be said."""


@dataclass(slots=True)
class Page:
    """What stands in a page's folder so far: the latest file of each kind, layers of objects."""

    folder: Path
    latest: dict[str, str] = field(default_factory=dict)
    layers: list[str] = field(default_factory=list)


def examples(page):
    """Yield the blocks of a page that are tried; raises ``ValueError`` for one without sense."""
    found = blocks(page)
    for place, block in enumerate(found):
        words = list(block.words)
        if words[:1] == ["yaml"] and len(words) > 1:
            words = words[1:]
        if not words or words[0] not in KINDS:
            continue
        kind, *rest = words
        wrong = rest.pop() if rest and rest[-1] in ("error", "warning") else ""
        name, expected, after = "".join(rest), "", None
        if wrong:
            after = found[place + 1] if place + 1 < len(found) else None
            if after is None or after.words != ("text",):
                raise ValueError(f"{block}: no block ```text says what is wrong with it")
            expected = after.text.rstrip()
        yield Example(block, kind, name, wrong, expected, after)


def make_folder(parent):
    """Return the empty folder of a page, beside the robots and systems that ship."""
    for shared in ("robots", "suts"):
        shutil.copytree(ROOT / "campaigns" / shared, parent / shared, dirs_exist_ok=True)
    folder = parent / "page"
    folder.mkdir()
    return Page(folder)


def try_example(page, example):
    """Write an example to the folder of its page; return what is not as the page says."""
    said = said_of(page, example)
    if said == example.expected:
        return ""
    wanted, got = example.expected or "nothing", said or "nothing"
    return f"{example.block}: should say\n{wanted}\nbut says\n{got}"


def said_of(page, example):
    """Write an example to the folder of its page; return all that is said of it."""
    text = _whole(page, example)
    name = example.name or _unnamed(example.kind)
    path = page.folder / name
    path.write_text(text, "utf-8")
    found = _composed(page, path) if example.kind == "scenery" else check_file(path)[1]
    if example.name and not example.wrong:
        page.latest[example.kind] = name
        if example.kind == "scenery" and _PLACE.search(text):
            page.layers.append(name)
    else:
        path.unlink()
    return "\n".join(dict.fromkeys(_said(one, page.folder, example) for one in found))


def _unnamed(kind):
    if kind in _LANGUAGES:
        return f"example.{kind}"
    return f"example.{kind}.yaml" if kind in _WHOLE else "example.yaml"


def _whole(page, example):
    """Return the text of a file that an example is, or is a part of."""
    text = example.block.text
    earlier = page.latest.get(example.kind, "")
    if example.kind == "variation" and "import" not in text:
        return f'import "{page.latest["fpm"]}"\n{text}'
    if example.name or not earlier or example.kind in _WHOLE:
        return text
    before = (page.folder / earlier).read_text("utf-8")
    if example.kind == "fpm":
        return text if text.lstrip().startswith("Floor plan") else before + text
    return with_keys(before, text)


def with_keys(before, text):
    """Return a YAML document with other top-level keys; indented ones join the last of them."""
    if text.startswith(" "):
        return before + text
    for key in re.findall(r"^([\w-]+):|# instead of ([\w-]+):", text, re.MULTILINE):
        before = re.sub(
            rf"^{key[0] or key[1]}:.*\n(?:(?:[ #].*)?\n)*", "", before, flags=re.MULTILINE
        )
    return before + text


_COMPOSED = "composition"
_COMPOSITION = """\
campaign: composition
limit: 5 min
robot: courier
matrix: {{sut: pilot}}
oracles: {oracles}
scenarios:
  all: {{floorplan: {plan}, objects: [{objects}], behaviours: [{behaviours}], mission: {mission},
        oracles: reached}}
"""


def _composed(page, path):
    """Check a layer on top of the layers of its page: in a campaign."""
    own = check_file(path)[1]
    if own or "fpm" not in page.latest:
        return own
    layers = list(dict.fromkeys((*page.layers, path.name)))
    objects = [name for name in layers if _PLACE.search((page.folder / name).read_text("utf-8"))]
    mission = page.latest.get("mission", f"{_COMPOSED}.mission.yaml")
    if "mission" not in page.latest:
        route = f"mission: {_COMPOSED}\nwaypoints: [{{x: 1.0, y: 0.0}}]\n"
        (page.folder / mission).write_text(route, "utf-8")
    oracles = f"{_COMPOSED}.oracles.yaml"
    (page.folder / oracles).write_text("reached: reached(mission, 0.3 m)\n", "utf-8")
    campaign = page.folder / f"{_COMPOSED}.yaml"
    campaign.write_text(
        _COMPOSITION.format(
            plan=page.latest["fpm"],
            mission=mission,
            oracles=oracles,
            objects=", ".join(objects),
            behaviours=", ".join(name for name in layers if name not in objects),
        ),
        "utf-8",
    )
    # A warning about the campaign is about this one, which names layers that only wait for others.
    found = check_file(campaign)[1]
    return [d for d in found if d.severity is Severity.ERROR or d.where.file != str(campaign)]


_PLACE = re.compile(r"\b(?:object|mover|starts?(?! to move)|frozen)\b|\bis an? ")
"""What is said of the scene, in layers that a campaign names among its objects."""


def _said(found, folder, example):
    hint = f"\n    {found.hint}" if found.hint else ""
    where = str(found.where).removeprefix(f"{folder}/")
    if example.expected.startswith(("error:", "warning:")):
        return f"{found.severity}: {found.message}{hint}".replace(f"{folder}/", "")
    return f"{where}: {found.severity}: {found.message}{hint}".replace(f"{folder}/", "")


def exercised(found):
    """Return rules and words of grammars, and keys of schemas, that examples make use of.

    Each is preceded by its language: ``scenery Walks``, ``robot drive.law``. Of texts with an
    error in their grammar there is nothing to say.
    """
    used = set()
    for example in found:
        if example.wrong != "error" or example.kind not in (*_LANGUAGES, "oracles"):
            used |= _exercised(example)
    return frozenset(used)


def _exercised(example):
    kind, text = example.kind, example.block.text
    if kind in _LANGUAGES:
        language = _LANGUAGES[kind]
        if kind == "fpm" and not text.lstrip().startswith("Floor plan"):
            text = f"Floor plan: part\n{text}"
        return {f"{language} {one}" for one in ebnf.used(language, text)}
    data = yaml.safe_load(text)
    if kind == "oracles":
        used = frozenset().union(*(ebnf.used("oracle", line) for line in data.values()))
        return {f"{grammar} {one}" for grammar in ("oracle", "expressions") for one in used}
    if kind == "campaign" and text.startswith(" "):
        data = {"scenarios": data}
    return {f"{kind} {one}" for one in tables.used_keys(kind, data)}
