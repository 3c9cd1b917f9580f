-- From schema 2: campaigns that are paused, that go first, that take turns.
ALTER TABLE campaign ADD COLUMN paused INTEGER NOT NULL DEFAULT 0;
ALTER TABLE campaign ADD COLUMN priority INTEGER NOT NULL DEFAULT 0;
ALTER TABLE campaign ADD COLUMN served INTEGER NOT NULL DEFAULT 0;

-- Whose turn it is, and which of its runs is next.
CREATE INDEX campaign_turn ON campaign (priority DESC, served, serial) WHERE finished_at IS NULL;
CREATE INDEX run_waiting ON run (campaign, serial) WHERE state = 'queued';
