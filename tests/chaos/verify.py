"""What must be true of a ledger and its traces, whatever was done to those who wrote them."""

import hashlib
import sqlite3
from collections import Counter
from contextlib import closing

from mcap.reader import make_reader

from daemon.batch.paths import StatePaths
from daemon.model.spec import RunResult
from grammars.text import codec
from tests.batch.ledger_rules import broken_rules
from tests.chaos.executor import MESSAGES


def verify(report, state, runs):
    """Check that each of ``runs`` runs has one result, and a trace that opens and is the one."""
    check_book(report, state / "ledger.db")
    with closing(sqlite3.connect(state / "ledger.db")) as db:
        states = Counter(row[0] for row in db.execute("SELECT state FROM run"))
        report.runs, report.lost = runs, states["lost"]
        report.expect(states == {"done": runs}, f"states of runs: {dict(states)}, wanted {runs}")
        results = db.execute("SELECT count(*), count(DISTINCT run) FROM result").fetchone()
        report.expect(results == (runs, runs), f"{results[0]} results of {results[1]} runs")
        report.fact("results, runs with a result", f"{results[0]}, {results[1]}")
        again = db.execute("SELECT total(attempt > 1), max(attempt) FROM run").fetchone()
        report.fact("runs leased again, most attempts", f"{again[0]:.0f}, {again[1]}")
        _check_traces(report, db, StatePaths(state), runs)


def check_book(report, ledger):
    """Check the ledger's own consistency only."""
    with closing(sqlite3.connect(ledger)) as db:
        whole = db.execute("PRAGMA integrity_check").fetchall()
        report.expect(whole == [("ok",)], f"integrity_check: {whole[:3]}")
        foreign = db.execute("PRAGMA foreign_key_check").fetchall()
        report.expect(not foreign, f"foreign_key_check: {foreign[:3]}")
        alarms = db.execute("SELECT count(*) FROM event WHERE kind = 'alarm'").fetchone()[0]
        report.expect(alarms == 0, f"{alarms} alarms of nondeterminism")
    broken = broken_rules(ledger)
    report.expect(not broken, "; ".join(broken))


def _check_traces(report, db, places, runs):
    opened = 0
    rows = db.execute("SELECT trace_name, body FROM run JOIN result ON result.run = run.id")
    for name, body in rows.fetchall():
        path = places.trace(name)
        if report.expect(path.is_file(), f"there is no trace {name}"):
            opened += _opens(report, path, codec.from_json(RunResult, body))
    report.fact("traces opened by the mcap reader", str(opened))
    report.expect(opened == runs, f"{opened} of {runs} traces open")


def _opens(report, path, result):
    data = path.read_bytes()
    same = hashlib.sha256(data).hexdigest() == result.trace.sha256
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        count = sum(1 for _ in reader.iter_messages())
    whole = summary is not None and count == MESSAGES
    return report.expect(same and whole, f"{path.name}: {count} messages, hash equal: {same}")
