"""Tutorials, followed word by word: files are written, commands are typed, outputs are compared.

A block with a file's name behind its language is that file; without one, and of a YAML kind, it
changes the file of its kind above. In blocks ```console lines that begin with ``$`` are typed, what
follows are lines of the output, in order; ``…`` stands for anything. Blocks ```python without a
file's name are executed one after the other, as cells of a notebook are: a block ```text behind one
is what it prints, the value of its last line included. A page that begins with
``<!-- continues PAGE -->`` finds the files of that page.
"""

import ast
import re
import sys
import tomllib
from contextlib import redirect_stdout
from io import StringIO

from grammars.text import plugins
from tests.docs.examples import KINDS, with_keys
from tests.docs.markdown import blocks

_CONTINUES = re.compile(r"<!-- continues (?P<page>\S+) -->")


def follow(page, folder, run):
    """Do what a tutorial says in ``folder`` and yield what is not as it says.

    ``run`` types a command there and returns its output.
    """
    earlier = _CONTINUES.match(page.read_text("utf-8"))
    if earlier is not None:
        for _ in follow(page.parent / earlier["page"], folder, lambda _: ""):
            pass
    latest, names, printed = {}, {}, None
    for block in blocks(page):
        if block.words == ("python",):
            printed = _printed(block, names)
        elif block.words == ("text",) and printed is not None:
            if not _agrees(printed, block.text.splitlines()):
                yield f"{block}: shows\n{block.text}but prints\n{printed}"
            printed = None
        elif block.words[:1] == ("console",):
            for command, *shown in _typed(block):
                output = run(command)
                if not _agrees(output, shown):
                    lines = "\n".join(shown)
                    yield f"{block}: {command}\nshows\n{lines}\nbut says\n{output}"
        else:
            _write(block, folder, latest)


def _printed(block, names):
    """Execute a block and return what it prints, the value of its last line included."""
    *body, last = ast.parse(block.text).body
    if not isinstance(last, ast.Expr):
        body, last = [*body, last], None
    with redirect_stdout(StringIO()) as out:
        exec(compile(ast.Module(body, []), str(block), "exec"), names)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), str(block), "eval"), names)
            if value is not None:
                print(repr(value))
    return out.getvalue()


def _write(block, folder, latest):
    words = list(block.words)
    kind = next((word for word in words if word in KINDS), "")
    name = words[-1] if words and "." in words[-1] else latest.get(kind, "")
    if not name:
        return
    path, text = folder / name, block.text
    named = name == words[-1]
    known = {word: other for word, other in latest.items() if other == name}
    # A campaign may have come from `scenario new`.
    changes = (known or kind == "campaign") and not _is_whole(kind, text)
    if kind and path.exists() and (not named or changes):
        text = with_keys(path.read_text("utf-8"), text)
    latest[kind] = name
    path.write_text(text, "utf-8")


def _is_whole(kind, text):
    return re.search(rf"^{kind}:", text, re.MULTILINE) is not None


def _typed(block):
    """Yield each command of a block, and the lines that are shown below it."""
    for part in re.split(r"^\$ ", block.text, flags=re.MULTILINE)[1:]:
        yield [line for line in part.splitlines() if line.strip()]


def _agrees(output, shown):
    """Whether the lines are there, in that order."""
    lines = iter([line.rstrip() for line in output.splitlines()])
    for one in shown:
        pattern = ".*".join(map(re.escape, one.rstrip().split("…")))
        if one != "…" and not any(re.fullmatch(pattern, line) for line in lines):
            return False
    return True


def install(folder):
    """Make the package of ``folder`` known to this process as ``pip install --editable`` does."""
    project = tomllib.loads((folder / "pyproject.toml").read_text("utf-8"))["project"]
    info = folder / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    info.mkdir(exist_ok=True)
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    )
    lines = []
    for group, entries in project["entry-points"].items():
        lines += [f"[{group}]", *(f"{name} = {where}" for name, where in entries.items())]
    (info / "entry_points.txt").write_text("\n".join([*lines, ""]))
    sys.path.insert(0, str(folder))
    plugins.installed.cache_clear()  # an earlier page may have looked for plug-ins
