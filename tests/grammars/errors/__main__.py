"""Write what is said anew: ``python -m tests.grammars.errors [LANGUAGE …]``, all by default."""

import sys
import tempfile
from pathlib import Path

from tests.grammars.errors.goldens import FILES, renew

for golden in FILES:
    if golden.stem in sys.argv[1:] or not sys.argv[1:]:
        with tempfile.TemporaryDirectory() as folder:
            text = renew(golden, Path(folder) / "files")
        if text != golden.read_text("utf-8"):
            golden.write_text(text, "utf-8")
            print(golden)
