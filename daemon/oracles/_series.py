"""Sampled signals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from grammars.values import Floats

Codes = npt.NDArray[np.int32]


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """A signal on the time base: ``values`` (n,) in SI units, 1 or 0 for true or false.

    NaN where the signal is not known (yet). ``objects`` (n,) index into ``names``, -1 for none:
    the object the value is about, such as the nearest wall. ``note`` says where it comes from.
    """

    values: Floats
    objects: Codes | None = None
    names: tuple[str, ...] = ()
    note: str = ""

    def object_at(self, index: int) -> str:
        """Return the name of the object involved at sample ``index``, or nothing."""
        if self.objects is None or self.objects[index] < 0:
            return ""
        return self.names[int(self.objects[index])]
