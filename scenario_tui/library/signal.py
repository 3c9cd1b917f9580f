"""A signal of a recorded run, as people plot it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from daemon.judging.signals import RunSignal

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class Signal(RunSignal):
    """A signal over simulated time.

    ``time`` [s] and ``value`` [``unit``] are arrays of the shape (n,); values are NaN where the
    signal is not known. What is true or false has the unit ``bool`` and the values 1 and 0.
    """

    @property
    def value(self) -> NDArray[np.float64]:
        """Every recorded value, (n,)."""
        return self.low

    def _repr_svg_(self) -> str:
        from daemon.analysis.charts import LINE, draw_charts, layer, quantity, standalone_svg

        columns = {"time": self.time.tolist(), "value": self.value.tolist()}
        ends = [float(self.time[0]), float(self.time[-1])]
        over_time = {
            "x": quantity("time", "time [s]", domain=ends),
            "y": quantity("value", f"{self.name} [{self.unit}]"),
        }
        curve = layer("line", columns, over_time, color=LINE, strokeWidth=1.2)
        size = {"width": 720, "height": 180, "background": "var(--paper)"}
        (drawing,) = draw_charts([curve | size], processes=1)
        return standalone_svg(drawing)
