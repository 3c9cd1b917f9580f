"""The command that tells numbers to monitoring: metrics."""

from __future__ import annotations

import typer

from scenario_tui.cli._options import AsJson, Connect, State


def metrics(connect: Connect = "", state: State = None, as_json: AsJson = False) -> None:
    """Write the daemon's numbers in the text format of Prometheus.

    Runs by state and outcome, workers and their slots, rate, disk; for node_exporter's textfile
    collector, say.
    """
    from daemon.operation import Standing, exposition
    from scenario_tui.cli._output import emit
    from scenario_tui.cli._session import Target

    with Target(connect, state).open() as daemon:
        standing = Standing(daemon.overview(), daemon.campaigns(), daemon.workers(), daemon.disk())
    if as_json:
        emit("metrics", standing=standing)
        return
    typer.echo(exposition(standing), nl=False)
