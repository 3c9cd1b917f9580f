-- From schema 3: where traces lie, whose they are, what kind of system a run needs.
ALTER TABLE run ADD COLUMN granted INTEGER NOT NULL DEFAULT 0;
ALTER TABLE run ADD COLUMN trace_at TEXT NOT NULL DEFAULT '';
ALTER TABLE run ADD COLUMN kind TEXT NOT NULL DEFAULT '';
UPDATE run SET granted = token, kind = coalesce(
    (SELECT json_extract(CAST(body AS TEXT), '$.sut.kind') FROM spec WHERE spec.run = run.id), '');

CREATE TABLE store (
    url TEXT PRIMARY KEY
) STRICT, WITHOUT ROWID;
