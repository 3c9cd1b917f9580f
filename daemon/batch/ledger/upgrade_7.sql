-- From schema 6: who was given a lease, and whose key brought a result; runs that wait after a failed
-- attempt; campaigns that are being entered or removed, part by part.
ALTER TABLE campaign ADD COLUMN visible INTEGER NOT NULL DEFAULT 1;
ALTER TABLE run ADD COLUMN not_before REAL NOT NULL DEFAULT 0;
ALTER TABLE run ADD COLUMN setbacks INTEGER NOT NULL DEFAULT 0;
ALTER TABLE run ADD COLUMN doubted INTEGER NOT NULL DEFAULT 0;
ALTER TABLE run ADD COLUMN outdated INTEGER NOT NULL DEFAULT 0;
ALTER TABLE run ADD COLUMN lapses INTEGER NOT NULL DEFAULT 0;
ALTER TABLE result ADD COLUMN holder TEXT NOT NULL DEFAULT '';

DROP INDEX run_waiting;
CREATE INDEX run_ready ON run (campaign, serial) WHERE state = 'queued' AND not_before = 0;
CREATE INDEX run_delayed ON run (not_before) WHERE state = 'queued' AND not_before > 0;
CREATE INDEX run_working ON run (worker, token) WHERE state = 'running';

CREATE TABLE lease (
    token      INTEGER PRIMARY KEY,
    run        TEXT NOT NULL REFERENCES run (id),
    attempt    INTEGER NOT NULL,
    worker     TEXT NOT NULL,
    holder     TEXT NOT NULL,
    granted_at REAL NOT NULL
) STRICT;

CREATE INDEX lease_run ON lease (run);
CREATE INDEX lease_worker ON lease (worker);

CREATE TABLE void_key (
    name TEXT PRIMARY KEY,
    at   REAL NOT NULL
) STRICT, WITHOUT ROWID;

-- The latest lease of each run: the only ones this schema knew, and not under whose names.
INSERT INTO meta SELECT 'unnamed', value FROM meta WHERE key = 'token';
INSERT INTO lease
    SELECT granted, id, attempt, worker, '', 0 FROM run WHERE granted > 0;

CREATE INDEX result_holder ON result (holder) WHERE holder <> '';
CREATE INDEX run_doubted ON run (digest) WHERE doubted = 1;
UPDATE run SET doubted = 1 WHERE id IN (SELECT id FROM event WHERE kind = 'alarm');

CREATE INDEX campaign_name ON campaign (name, serial);
CREATE INDEX campaign_hidden ON campaign (id) WHERE visible = 0;
CREATE INDEX run_cached ON run (cached) WHERE cached <> '';
DROP TRIGGER run_counted;
