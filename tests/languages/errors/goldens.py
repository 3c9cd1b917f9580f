"""Golden files of messages: files with a mistake, and every finding of ``scenario check``.

A golden file, ``LANGUAGE.txt``, is read from top to bottom::

    === plan.fpm            a file, up to the next mark; files in a row lie in one folder, and the
    Floor plan: house       last one is checked
    …

    === two_rooms/          all files of a folder beside the golden file

    --- wrt: a => wrt: b    a case: words and their substitute; the words occur exactly once in the
                            checked file, or else in one of the others
    plan.fpm:3:5: error: …  the findings, up to an empty line

    --- var w = 3           a case of another kind: text in place of the line "…"
    --- wrt: a => wrt: b    one case may have both, in any number of lines
    …

Every line of a case begins with ``---``. Lines between cases are for readers alone.
``pytest tests/languages/errors --update`` renews the findings.
"""

import re
import shutil
from pathlib import Path

from scenario_tui.library.checking import check_file

GOLDENS = tuple(sorted(Path(__file__).parent.glob("*.txt")))
_PLACE = "…"
_ROOT = f"{Path(__file__).parents[3]}/"
_BLOCK = re.compile(
    r"^=== (?P<name>.+)\n(?P<text>(?:(?!===|---|## ).*\n)*)"
    r"|^(?P<case>(?:---(?: .*)?\n)+)(?:(?!---).+\n)*",
    re.MULTILINE,
)
_SUBSTITUTION = re.compile(r"^(.+?) =>(?: |$)", re.MULTILINE)


def findings(path):
    """Return the findings of a check, with one line for each message and each hint."""
    return "".join(finding_lines(check_file(path)[1]))


def finding_lines(found):
    return [
        f"{one.where}: {one.severity}: {one.message}\n" + (f"    {one.hint}\n" if one.hint else "")
        for one in found
    ]


def renew(golden, folder, describe=findings):
    """Return the text of a golden file with what ``describe`` says today of each case.

    ``folder`` does not exist yet; the files of each case lie there while they are described.
    """
    files, checked, row_is_complete = {}, "", True

    def renew_block(block):
        nonlocal checked, row_is_complete
        if block["case"] is None:
            if row_is_complete:
                files.clear()
            row = _files(golden.parent, block["name"], block["text"])
            files.update(row)
            checked, row_is_complete = list(row)[-1], False
            return block[0]
        row_is_complete = True
        case = "\n".join(line[4:] for line in block["case"].splitlines())
        try:
            _write(_changed(files, checked, case), folder)
            text = describe(folder / checked).replace(f"{folder}/", "").replace(_ROOT, "")
            shutil.rmtree(folder)
            return block["case"] + (text or "nothing\n")
        except Exception as error:
            error.add_note(f"{golden.name}: {case}")
            raise

    return _BLOCK.sub(renew_block, golden.read_text("utf-8"))


def _files(folder, name, text):
    """Return the texts of a file, or of all files of a folder, by their names."""
    if not name.endswith("/"):
        return {name: text.rstrip("\n") + "\n"}
    paths = sorted(filter(Path.is_file, (folder / name).rglob("*")))
    return {str(path.relative_to(folder / name)): path.read_text("utf-8") for path in paths}


def _changed(files, checked, case):
    """Return the files with the change of a case."""
    added, *parts = _SUBSTITUTION.split(case)
    added = added.removesuffix("\n")
    files = {name: text.replace(f"{_PLACE}\n", f"{added}\n") for name, text in files.items()}
    for old, new in zip(parts[::2], parts[1::2], strict=True):
        names = [checked] if old in files[checked] else files
        (name,) = (name for name in names for _ in range(files[name].count(old)))
        files[name] = files[name].replace(old, new.removesuffix("\n"))
    return files


def _write(files, folder):
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, "utf-8")
