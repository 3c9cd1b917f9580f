"""Localisation signals: the estimate and its confidence against the true pose.

An estimate is compared with the true pose at the time it was taken (its stamp), interpolated
between ground-truth samples, and held until the next one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from daemon.oracles._series import Series
from daemon.oracles._timeline import hold
from grammars.values import Floats

if TYPE_CHECKING:
    from daemon.trace import PoseTrack, Trace


class Localisation:
    """Samples ``loc.*`` of one trace on ``time`` (n,)."""

    def __init__(self, trace: Trace, time: Floats) -> None:
        self._trace, self._time = trace, time
        has_cloud = len(trace.cloud.time) > 0
        self._spread = trace.cloud if has_cloud else trace.estimate
        self._note = "from the particle cloud" if has_cloud else "from the estimate's covariance"

    def sample(self, name: str) -> Series:
        """Return the signal ``name`` (``loc.error``, ``loc.sigma.x``, …)."""
        estimate = self._trace.estimate
        if name == "loc.age":
            return Series(self._time - hold(estimate.time, estimate.time, self._time))
        if name == "loc.inside_2sigma":
            return self._hold(self._spread, self._inside(), self._note)
        if name.startswith("loc.sigma"):
            axis = ("x", "y", "yaw").index(name.rpartition(".")[2])
            return self._hold(self._spread, self._sigma(axis), self._note)
        dx, dy, dyaw = self._difference(estimate)
        values = {
            "loc.error": np.hypot(dx, dy),
            "loc.error.x": dx,
            "loc.error.y": dy,
            "loc.error.yaw": dyaw,
        }[name]
        return self._hold(estimate, values, "")

    def _hold(self, track: PoseTrack, values: Floats, note: str) -> Series:
        return Series(hold(track.time, values, self._time), note=note)

    def _sigma(self, axis: int) -> Floats:
        variance = self._spread.covariance[:, axis, axis]
        sigma: Floats = np.sqrt(np.maximum(variance, 0.0))
        return sigma

    def _inside(self) -> Floats:
        """Equation 1 of the paper, on x and on y: ``|mean - truth| <= 2 sigma``."""
        dx, dy, _ = self._difference(self._spread)
        inside = (np.abs(dx) <= 2.0 * self._sigma(0)) & (np.abs(dy) <= 2.0 * self._sigma(1))
        return inside.astype(np.float64)

    def _difference(self, track: PoseTrack) -> tuple[Floats, Floats, Floats]:
        """Return ``track`` minus truth at its stamps: x, y [m], yaw [rad] in (-pi, pi]."""
        truth, stamps = self._trace.ground_truth, track.time
        if not len(truth.time):
            empty = np.full(len(stamps), np.nan)
            return empty, empty, empty
        x = np.interp(stamps, truth.time, truth.x)
        y = np.interp(stamps, truth.time, truth.y)
        yaw = np.interp(stamps, truth.time, np.unwrap(truth.yaw))
        turned = np.pi - np.mod(np.pi - (track.yaw - yaw), 2.0 * np.pi)
        return track.x - x, track.y - y, turned
