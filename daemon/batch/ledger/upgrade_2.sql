-- From schema 1: what campaigns declare, results used again, repeats in reserve.
ALTER TABLE campaign ADD COLUMN declared BLOB NOT NULL DEFAULT '';
ALTER TABLE campaign ADD COLUMN fresh INTEGER NOT NULL DEFAULT 0;
ALTER TABLE campaign ADD COLUMN cached INTEGER NOT NULL DEFAULT 0;
ALTER TABLE run ADD COLUMN seed TEXT NOT NULL DEFAULT '0';
ALTER TABLE run ADD COLUMN cached TEXT NOT NULL DEFAULT '';

-- What lets a new run find an old result of the same specification.
CREATE INDEX run_result ON run (digest) WHERE result <> '';

-- Repeats for cells that are not decided by those before; they become runs when they are needed.
CREATE TABLE reserve (
    campaign TEXT NOT NULL REFERENCES campaign (id),
    position INTEGER NOT NULL,
    scenario TEXT NOT NULL,
    sut      TEXT NOT NULL,
    repeat   INTEGER NOT NULL,
    body     BLOB NOT NULL,
    PRIMARY KEY (campaign, position)
) STRICT, WITHOUT ROWID;
