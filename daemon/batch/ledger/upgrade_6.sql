-- From schema 5: systems under test that are not repeatable. There were none before.
ALTER TABLE run ADD COLUMN repeatable INTEGER NOT NULL DEFAULT 1;
