"""Support for editors: JSON Schemas of the YAML files, highlighting, an extension for VS Code.

``schemas/`` holds the published schemas (made by ``scenario schema``), ``vscode/`` the extension
with a TextMate grammar for each language. :mod:`grammars.editor.oracles` makes the schema of
oracle layers.
"""

from __future__ import annotations

import io
import json
import zipfile
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Final
from xml.sax.saxutils import escape, quoteattr

from grammars.editor._schemas import editor_schema, nullable

_CONTENT_TYPES: Final = """\
<?xml version="1.0" encoding="utf-8"?>
<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">
  <Default Extension=".json" ContentType="application/json"/>
  <Default Extension=".js" ContentType="application/javascript"/>
  <Default Extension=".md" ContentType="text/markdown"/>
  <Default Extension=".vsixmanifest" ContentType="text/xml"/>
</Types>
"""

_MANIFEST: Final = """\
<?xml version="1.0" encoding="utf-8"?>
<PackageManifest Version="2.0.0" xmlns="http://schemas.microsoft.com/developer/vsx-schema/2011">
  <Metadata>
    <Identity Language="en-US" Id={name} Version={version} Publisher={publisher}/>
    <DisplayName>{title}</DisplayName>
    <Description xml:space="preserve">{about}</Description>
    <Categories>{categories}</Categories>
    <Properties>
      <Property Id="Microsoft.VisualStudio.Code.Engine" Value={engine}/>
    </Properties>
  </Metadata>
  <Installation>
    <InstallationTarget Id="Microsoft.VisualStudio.Code"/>
  </Installation>
  <Dependencies/>
  <Assets>
    <Asset Type="Microsoft.VisualStudio.Code.Manifest"
           Path="extension/package.json" Addressable="true"/>
    <Asset Type="Microsoft.VisualStudio.Services.Content.Details"
           Path="extension/README.md" Addressable="true"/>
  </Assets>
</PackageManifest>
"""

_ZIP_EPOCH: Final = (1980, 1, 1, 0, 0, 0)
"""Earliest time in a zip archive: the same files always give the same bytes."""


def pack_extension() -> bytes:
    """Return the extension with its schemas as a .vsix file: a zip archive with a manifest."""
    here = files("grammars.editor")
    contents = _tree(here / "vscode", "extension") | _tree(here / "schemas", "extension/schemas")
    contents["extension.vsixmanifest"] = _manifest((here / "vscode" / "package.json").read_text())
    contents["[Content_Types].xml"] = _CONTENT_TYPES.encode()
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in sorted(contents.items()):
            archive.writestr(zipfile.ZipInfo(name, _ZIP_EPOCH), data, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def _tree(folder: Traversable, name: str) -> dict[str, bytes]:
    contents: dict[str, bytes] = {}
    for item in folder.iterdir():
        path = f"{name}/{item.name}"
        contents |= _tree(item, path) if item.is_dir() else {path: item.read_bytes()}
    return contents


def _manifest(package: str) -> bytes:
    about = json.loads(package)
    return _MANIFEST.format(
        name=quoteattr(about["name"]),
        version=quoteattr(about["version"]),
        publisher=quoteattr(about["publisher"]),
        engine=quoteattr(about["engines"]["vscode"]),
        title=escape(about["displayName"]),
        about=escape(about["description"]),
        categories=escape(",".join(about["categories"])),
    ).encode()
