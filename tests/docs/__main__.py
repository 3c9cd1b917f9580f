"""Write the made parts of the documentation anew.

``python -m tests.docs`` writes grammars and tables; with ``--messages`` also what is said
of each example that is wrong, and with ``--notebooks`` what notebooks show. Look at the difference:
it is what people will read.
"""

import sys
import tempfile
from pathlib import Path

from tests.docs import examples, regions
from tests.docs.markdown import LANGUAGES


def _write(page, text):
    if not page.exists() or page.read_text("utf-8") != text:
        page.write_text(text, "utf-8")
        print(page)


def _with_messages(page):
    lines = page.read_text("utf-8").splitlines()
    with tempfile.TemporaryDirectory() as parent:
        folder = examples.make_folder(Path(parent))
        tried = [
            (example, examples.said_of(folder, example)) for example in examples.examples(page)
        ]
    # From the end, since lines before a change keep their numbers.
    for example, said in reversed(tried):
        if example.shown is not None and said:
            start = example.shown.line - 1
            lines[start : start + example.shown.text.count("\n")] = said.splitlines()
    return "\n".join((*lines, ""))


for made, text in regions.made_pages():
    _write(made, text)
if "--messages" in sys.argv:
    for written in sorted(LANGUAGES.glob("*.md")):
        _write(written, _with_messages(written))
if "--notebooks" in sys.argv:
    from tests.docs import notebooks

    for path in notebooks.NOTEBOOKS:
        notebooks.write_anew(path)
