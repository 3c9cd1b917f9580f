"""Texts of values that travel, with what each may hold: they come from the network.

Apart from the messages of the bus, for who reads campaign files needs no message.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

IdText = Annotated[str, Field(max_length=128)]
WorkerId = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,99}$")]
ShortText = Annotated[str, Field(max_length=400)]
Sha256Text = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
