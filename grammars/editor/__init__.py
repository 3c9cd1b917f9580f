"""What editors need: JSON Schemas of the YAML files, highlighting, an extension for VS Code.

``schemas/`` holds the published schemas (made by ``scenario schema``), ``vscode/`` the extension
with a TextMate grammar for each language.
"""

from grammars.editor._extension import pack_extension
from grammars.editor._keywords import literals
from grammars.editor._oracles import oracle_schema
from grammars.editor._schema import editor_schema
from grammars.editor._units import quantity_pattern

__all__ = ["editor_schema", "literals", "oracle_schema", "pack_extension", "quantity_pattern"]
