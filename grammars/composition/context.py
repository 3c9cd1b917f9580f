"""What the sentences of one layer share: parameters, chance, frames."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from grammars.diagnostics import Diagnostic, InputError, did_you_mean
from grammars.scenery.model import Amount, Name, SceneryLayer
from grammars.scenery.units import Measure, require
from grammars.values import Pose2


class Context:
    """What the sentences of one layer share."""

    def __init__(
        self,
        layer: SceneryLayer,
        seed: np.random.SeedSequence,
        limit: float,
        frames: Mapping[str, Pose2],
    ) -> None:
        self.layer = layer
        self.frames = frames
        self.seed = seed
        self.limit = limit
        self.parameters: dict[str, Measure] = {p.name: p.value for p in layer.parameters}

    def value(self, amount: Amount, *dimensions: str) -> float:
        """Return the SI value of a quantity or parameter."""
        if not isinstance(amount, Name):
            return require(amount, *dimensions)
        given = self.parameters.get(amount.text)
        if given is None:
            hint = did_you_mean(amount.text, self.parameters) or (
                f"declare it: parameter {amount} = …"
            )
            raise InputError(Diagnostic(amount.where, f'there is no parameter "{amount}"', hint))
        return require(given, *dimensions)

    def optional(self, amount: Amount | None, default: float, *dimensions: str) -> float:
        """Return the SI value, or ``default`` when nothing was said."""
        return default if amount is None else self.value(amount, *dimensions)
