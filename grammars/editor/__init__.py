"""What editors need: JSON Schemas of the YAML files, highlighting, an extension for VS Code.

``schemas/`` holds the published schemas (made by ``scenario schema``), ``vscode/`` the extension
with a TextMate grammar for each language. :mod:`grammars.editor.oracles` makes the schema of
oracle layers.
"""

from grammars.editor._extension import pack_extension
from grammars.editor._schemas import (
    QUANTITY_EXAMPLES,
    editor_schema,
    nullable,
    quantity_pattern,
)

__all__ = [
    "QUANTITY_EXAMPLES",
    "editor_schema",
    "nullable",
    "pack_extension",
    "quantity_pattern",
]
