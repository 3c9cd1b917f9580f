"""Rules that hold in every ledger, at any moment: tests and chaos examine files with them."""

from daemon.batch.ledger._connection import open_reader

RULES = {
    "runs are counted as done and have no result": (
        "SELECT count(*) FROM run LEFT JOIN result ON result.run = run.id"
        " WHERE run.result <> '' AND result.run IS NULL"
    ),
    "results differ from what their run says": (
        "SELECT count(*) FROM result JOIN run ON run.id = result.run"
        " WHERE run.result <> result.digest"
    ),
    "runs are queued in campaigns that are closed": (
        "SELECT count(*) FROM run JOIN campaign ON campaign.id = run.campaign"
        " WHERE state IN ('queued', 'running') AND campaign.finished_at IS NOT NULL"
    ),
    "runs are proposed and not there": (
        "SELECT count(*) FROM proposal LEFT JOIN run ON run.id = proposal.run WHERE run.id IS NULL"
    ),
    "searches wait in campaigns that are closed": (
        "SELECT count(*) FROM search JOIN campaign ON campaign.id = search.campaign"
        " WHERE search.state = 'waiting' AND campaign.finished_at IS NOT NULL"
    ),
    # The tally is kept by triggers; a row of it may count no run, so it stands on the right side.
    "counts differ from the runs": (
        "SELECT count(*) FROM (SELECT campaign, state, outcome, count(*) AS runs FROM run"
        " GROUP BY campaign, state, outcome) AS found LEFT JOIN tally USING"
        " (campaign, state, outcome) WHERE tally.runs IS NOT found.runs"
    ),
}


def broken_rules(ledger):
    """Return the rules that a ledger breaks, each with how often."""
    with open_reader(ledger) as db:
        db.execute("BEGIN")  # one snapshot: numbers that must agree are counted one by one
        counts = {words: db.execute(rule).fetchone()[0] for words, rule in RULES.items()}
    return [f"{count} {words}" for words, count in counts.items() if count]
