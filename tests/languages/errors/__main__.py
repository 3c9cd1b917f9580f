"""Renew golden files of messages: ``python -m tests.languages.errors [LANGUAGE …]``."""

import sys
import tempfile
from pathlib import Path

from tests.languages.errors.goldens import GOLDENS, renew

for golden in GOLDENS:
    if golden.stem in sys.argv[1:] or not sys.argv[1:]:
        with tempfile.TemporaryDirectory() as folder:
            text = renew(golden, Path(folder) / "files")
        if text != golden.read_text("utf-8"):
            golden.write_text(text, "utf-8")
            print(golden)
