"""What editors need: JSON Schemas of the YAML files, highlighting, an extension for VS Code.

``schemas/`` holds the published schemas (made by ``scenario schema``), ``vscode/`` the extension
with a TextMate grammar for each language.
"""

from grammars.editor._extension import pack_extension
from grammars.editor._schemas import (
    QUANTITY_EXAMPLES,
    editor_schema,
    literals,
    oracle_schema,
    quantity_pattern,
)

__all__ = [
    "QUANTITY_EXAMPLES",
    "editor_schema",
    "literals",
    "oracle_schema",
    "pack_extension",
    "quantity_pattern",
]
