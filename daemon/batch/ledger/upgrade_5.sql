-- From schema 4: what runs share is kept once. Bodies written before stay as they are.
CREATE TABLE part (
    name TEXT PRIMARY KEY,
    body BLOB NOT NULL
) STRICT, WITHOUT ROWID;
