-- From schema 7: searches. There were none before.
CREATE TABLE search (
    campaign   TEXT PRIMARY KEY REFERENCES campaign (id),
    task       BLOB NOT NULL,
    file       TEXT NOT NULL,
    state      TEXT NOT NULL DEFAULT 'running',
    phase      TEXT NOT NULL DEFAULT 'explore',
    note       TEXT NOT NULL DEFAULT '',
    answer     BLOB NOT NULL DEFAULT x'',
    updated_at REAL NOT NULL
) STRICT, WITHOUT ROWID;

CREATE INDEX search_running ON search (campaign) WHERE state = 'running';

-- What each run of a search is about, by its position; ``vals`` is a list in JSON.
CREATE TABLE proposal (
    campaign TEXT NOT NULL REFERENCES campaign (id),
    position INTEGER NOT NULL,
    number   INTEGER NOT NULL,
    repeat   INTEGER NOT NULL,
    phase    TEXT NOT NULL,
    method   TEXT NOT NULL,
    guided   INTEGER NOT NULL,
    vals     BLOB NOT NULL,
    note     TEXT NOT NULL,
    PRIMARY KEY (campaign, position)
) STRICT, WITHOUT ROWID;
