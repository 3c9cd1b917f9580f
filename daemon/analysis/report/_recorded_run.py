"""Pictures of one recorded run, for pages that are about a single run."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from daemon.analysis.report._axes import Sheet
from daemon.analysis.report._plots import plot_limits, plot_way
from daemon.analysis.report._recorded import sampled_trace
from daemon.analysis.report._safety_buffer import buffer_of_run
from daemon.analysis.report._tracks import RunTracks, extract_tracks
from daemon.judging import oracles
from daemon.trace import TraceError
from grammars.model.scene import Scene

_POINTS: Final = 600
"""Samples drawn of the way."""


def plot_recorded_way(trace: Path) -> Sheet | None:
    """Return the way driven in a run, coloured by the distance to obstacles.

    ``None`` if the trace cannot be read any more or not be trusted, or if no distance is known.
    """
    found = _recorded(trace)
    if found is None or np.isnan(found[0].clearance).all():
        return None
    tracks, scene = found
    return plot_way([tracks], plot_limits([tracks]), scene)


def _recorded(trace: Path) -> tuple[RunTracks, Scene] | None:
    try:
        sampler = sampled_trace(trace)
    except TraceError:
        return None
    recorded = sampler.trace
    if oracles.trace_problems(recorded):
        return None
    buffer = buffer_of_run(recorded.spec)
    tracks = extract_tracks(recorded.spec.label, recorded, sampler, buffer, (), _POINTS)
    return (tracks, recorded.scene) if len(tracks.time) > 1 else None
