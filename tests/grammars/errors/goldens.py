"""Golden files: what ``scenario check`` says of files with a mistake, all of it.

A golden file, ``LANGUAGE.txt``, is read from top to bottom::

    === plan.fpm            a file of a folder, up to the next mark; of several in a row the
    Floor plan: house       last one is checked, and the first of a row begins another folder
    …

    === two_rooms/          also the files of a folder beside the golden file

    --- wrt: a => wrt: b    a change: words and their substitutes; the file that is checked holds
                            the words exactly once, otherwise one of the other files does
    plan.fpm:3:5: error: …  all that is said of it, up to an empty line

    --- var w = 3           a change of another kind: a text in place of the line "…"
    --- wrt: a => wrt: b    both kinds may stand in one change, each of several lines
    …

Every line of a change begins with ``---``; the lines between cases are for readers alone.
``python -m tests.grammars.errors [LANGUAGE …]`` writes anew what is said.
"""

import difflib
import re
import shutil
from pathlib import Path

from scenario_tui.file_check import check_file

FILES = tuple(sorted(Path(__file__).parent.glob("*.txt")))
_PLACE = "…"
_BLOCK = re.compile(
    r"^=== (?P<name>.+)\n(?P<text>(?:(?!===|---|## ).*\n)*)"
    r"|^(?P<change>(?:---(?: .*)?\n)+)(?:(?!---).+\n)*",
    re.MULTILINE,
)
_SUBSTITUTION = re.compile(r"^(.+?) =>(?: |$)", re.MULTILINE)


def renew(golden, folder):
    """Return the text of a golden file with what is said today; ``folder`` is not there yet."""
    files, checked, is_complete = {}, "", True

    def block(found):
        nonlocal checked, is_complete
        if found["change"] is None:
            if is_complete:
                files.clear()
            is_complete, checked = False, found["name"]
            files[checked] = found["text"].rstrip("\n") + "\n"
            if checked.endswith("/"):
                del files[checked]
                shared = golden.parent / checked
                for file in sorted(filter(Path.is_file, shared.rglob("*"))):
                    checked = str(file.relative_to(shared))
                    files[checked] = file.read_text("utf-8")
            return found[0]
        is_complete = True
        change = "\n".join(line[4:] for line in found["change"].splitlines())
        try:
            return found["change"] + _messages(_changed(files, change, checked), folder, checked)
        except Exception as error:
            error.add_note(f"{golden.name}: {change}")
            raise

    return _BLOCK.sub(block, golden.read_text("utf-8"))


def _changed(files, change, checked):
    """Return the files with the change of a case made."""
    added, *parts = _SUBSTITUTION.split(change)
    added = added.removesuffix("\n")
    files = {name: text.replace(f"{_PLACE}\n", f"{added}\n") for name, text in files.items()}
    for old, new in zip(parts[::2], parts[1::2], strict=True):
        names = [checked] if old in files[checked] else files
        (name,) = (name for name in names for _ in range(files[name].count(old)))
        files[name] = files[name].replace(old, new.removesuffix("\n"))
    return files


def _messages(files, folder, checked):
    """Return what is said of a file among others in a folder, a line for each message or hint."""
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, "utf-8")
    _, found = check_file(folder / checked)
    shutil.rmtree(folder)
    lines = [
        f"{one.where}: {one.severity}: {one.message}\n" + (f"    {one.hint}\n" if one.hint else "")
        for one in found
    ]
    return "".join(lines).replace(f"{folder}/", "") or "nothing\n"


def difference(golden, folder):
    """Return how what is said differs from a golden file, as a text; empty if it does not."""
    old, new = golden.read_text("utf-8"), renew(golden, folder)
    lines = difflib.unified_diff(old.splitlines(), new.splitlines(), golden.name, "today", n=5)
    return "\n".join(lines)
