CREATE TABLE meta (
    key   TEXT PRIMARY KEY,
    value INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

INSERT INTO meta VALUES ('token', 0);

-- The starts of daemons on this ledger, and the latest lease before each. They are unique to this
-- ledger; a copy has only those from before it was made.
CREATE TABLE era (
    serial INTEGER PRIMARY KEY,
    id     TEXT NOT NULL UNIQUE,
    token  INTEGER NOT NULL
) STRICT;

CREATE TABLE campaign (
    serial       INTEGER PRIMARY KEY,
    id           TEXT NOT NULL UNIQUE,
    name         TEXT NOT NULL,
    about        TEXT NOT NULL,
    source       TEXT NOT NULL,
    digest       TEXT NOT NULL,
    total        INTEGER NOT NULL,
    submitted_at REAL NOT NULL,
    finished_at  REAL,
    declared     BLOB NOT NULL DEFAULT '',
    fresh        INTEGER NOT NULL DEFAULT 0,
    cached       INTEGER NOT NULL DEFAULT 0,
    paused       INTEGER NOT NULL DEFAULT 0,
    priority     INTEGER NOT NULL DEFAULT 0,
    served       INTEGER NOT NULL DEFAULT 0, -- token of its latest lease
    origin       BLOB NOT NULL DEFAULT x'',  -- its file and commit
    lacks        TEXT NOT NULL DEFAULT '',   -- missing input: 'scene DIGEST', 'file DIGEST', 'engine N'
    acknowledged INTEGER NOT NULL DEFAULT 0  -- 1: a person has seen all its bad runs
) STRICT;

-- Campaigns of one priority take turns.
CREATE INDEX campaign_turn ON campaign (priority DESC, served, serial) WHERE finished_at IS NULL;
CREATE INDEX campaign_name ON campaign (name, serial);

-- Common parts of a campaign's runs: cells (without repeat, seed and behaviours) and behaviours.
CREATE TABLE cell (
    campaign TEXT NOT NULL REFERENCES campaign (id) ON DELETE CASCADE,
    number   INTEGER NOT NULL,
    body     BLOB NOT NULL,
    PRIMARY KEY (campaign, number)
) STRICT, WITHOUT ROWID;

CREATE TABLE script (
    campaign TEXT NOT NULL REFERENCES campaign (id) ON DELETE CASCADE,
    number   INTEGER NOT NULL,
    body     BLOB NOT NULL,
    PRIMARY KEY (campaign, number)
) STRICT, WITHOUT ROWID;

-- One row per run, small, since lists read only these. Empty text means "none yet". A repeat in the
-- state "reserve" is hidden until the repeats before leave its cell undecided; then it is queued.
CREATE TABLE run (
    serial      INTEGER PRIMARY KEY,
    id          TEXT NOT NULL UNIQUE,
    campaign    TEXT NOT NULL REFERENCES campaign (id) ON DELETE CASCADE,
    position    INTEGER NOT NULL,
    cell        INTEGER NOT NULL,
    script      INTEGER NOT NULL,
    scenario    TEXT NOT NULL,
    sut         TEXT NOT NULL,
    repeat      INTEGER NOT NULL,
    time_limit  REAL NOT NULL,
    digest      TEXT NOT NULL,
    trace_name  TEXT NOT NULL,
    state       TEXT NOT NULL DEFAULT 'queued',
    attempt     INTEGER NOT NULL DEFAULT 0,
    strikes     INTEGER NOT NULL DEFAULT 0,
    worker      TEXT NOT NULL DEFAULT '',
    token       INTEGER NOT NULL DEFAULT 0,
    result      TEXT NOT NULL DEFAULT '',
    reason      TEXT NOT NULL DEFAULT '',
    outcome     TEXT NOT NULL DEFAULT '',
    oracle      TEXT NOT NULL DEFAULT '',
    margin      REAL,
    unit        TEXT NOT NULL DEFAULT '',
    simulated   REAL NOT NULL DEFAULT 0,
    wall        REAL NOT NULL DEFAULT 0,
    finished_at REAL,
    seed        TEXT NOT NULL DEFAULT '0',
    cached      TEXT NOT NULL DEFAULT '',
    granted     INTEGER NOT NULL DEFAULT 0,  -- token of its latest lease, even if that is over
    leased_at   REAL NOT NULL DEFAULT 0,     -- time of that lease
    trace_at    TEXT NOT NULL DEFAULT '',    -- URL of its trace, empty for the state directory
    kind        TEXT NOT NULL DEFAULT '',    -- of its system under test
    repeatable  INTEGER NOT NULL DEFAULT 1,  -- 0: its system answers differently each time
    doubted     INTEGER NOT NULL DEFAULT 0,  -- 1: its specification has had different results
    outdated    INTEGER NOT NULL DEFAULT 0,  -- leases up to this token are from before a retry
    lapses      INTEGER NOT NULL DEFAULT 0,  -- lapsed leases in a row
    nondeterministic INTEGER NOT NULL DEFAULT 0, -- 1: it has had different results, see "reason"
    UNIQUE (campaign, position),
    UNIQUE (trace_name),
    FOREIGN KEY (campaign, cell) REFERENCES cell (campaign, number),
    FOREIGN KEY (campaign, script) REFERENCES script (campaign, number)
) STRICT;

CREATE INDEX run_queue ON run (state, serial);
-- Runs ready for a lease, those with fewer leases first.
CREATE INDEX run_ready ON run (campaign, attempt, serial) WHERE state = 'queued';
-- Runs of each worker, read with every request for work and every renewal.
CREATE INDEX run_working ON run (worker, token) WHERE state = 'running';
-- Old results of the same specification, for new runs.
CREATE INDEX run_result ON run (digest) WHERE result <> '';
-- Runs that reuse the result of a run, for its removal.
CREATE INDEX run_cached ON run (cached) WHERE cached <> '';
CREATE INDEX run_doubted ON run (digest) WHERE doubted = 1;
CREATE INDEX run_finished ON run (finished_at) WHERE finished_at IS NOT NULL;

-- The primary key ensures one result per run.
CREATE TABLE result (
    run     TEXT PRIMARY KEY REFERENCES run (id) ON DELETE CASCADE,
    attempt INTEGER NOT NULL,
    worker  TEXT NOT NULL,
    digest  TEXT NOT NULL,
    at      REAL NOT NULL,
    body    BLOB NOT NULL
) STRICT, WITHOUT ROWID;

CREATE TABLE event (
    seq      INTEGER PRIMARY KEY AUTOINCREMENT,
    at       REAL NOT NULL,
    kind     TEXT NOT NULL,
    id       TEXT NOT NULL,
    campaign TEXT NOT NULL,
    state    TEXT NOT NULL,
    note     TEXT NOT NULL DEFAULT ''
) STRICT;

-- Numbers of runs by state and outcome, so that counting never reads the runs. Entering runs counts
-- them, many at a time; a trigger updates the numbers when runs change.
CREATE TABLE tally (
    campaign TEXT NOT NULL REFERENCES campaign (id) ON DELETE CASCADE,
    state    TEXT NOT NULL,
    outcome  TEXT NOT NULL,
    runs     INTEGER NOT NULL,
    PRIMARY KEY (campaign, state, outcome)
) STRICT, WITHOUT ROWID;

CREATE TRIGGER run_recounted AFTER UPDATE OF state, outcome ON run
WHEN old.state <> new.state OR old.outcome <> new.outcome BEGIN
    UPDATE tally SET runs = runs - 1
        WHERE campaign = old.campaign AND state = old.state AND outcome = old.outcome;
    INSERT INTO tally VALUES (new.campaign, new.state, new.outcome, 1)
        ON CONFLICT DO UPDATE SET runs = runs + 1;
END;

-- An acknowledgement covers the bad runs so far. It ends with a new bad run, with a different result,
-- and with a retry.
CREATE TRIGGER news AFTER UPDATE OF state, outcome, nondeterministic ON run
WHEN (new.state = 'lost' AND old.state <> 'lost')
    OR (new.outcome IN ('fail', 'error', 'inconclusive') AND new.outcome <> old.outcome)
    OR new.nondeterministic > old.nondeterministic
    OR (new.state = 'queued' AND old.state IN ('done', 'lost', 'cancelled')) BEGIN
    UPDATE campaign SET acknowledged = 0 WHERE id = new.campaign AND acknowledged;
END;

-- Campaigns whose runs a client proposes one by one; ``file`` is the campaign file as typed.
-- ``task`` and ``progress``, the latest report of the client, are JSON.
CREATE TABLE search (
    campaign TEXT PRIMARY KEY REFERENCES campaign (id) ON DELETE CASCADE,
    task     BLOB NOT NULL,
    file     TEXT NOT NULL,
    state    TEXT NOT NULL DEFAULT 'waiting',
    progress BLOB NOT NULL
) STRICT, WITHOUT ROWID;

-- The proposal of each run of a search, in JSON.
CREATE TABLE proposal (
    run  TEXT PRIMARY KEY REFERENCES run (id) ON DELETE CASCADE,
    body BLOB NOT NULL
) STRICT, WITHOUT ROWID;
