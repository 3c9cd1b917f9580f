-- From schema 8: where campaigns were written. Of those before it is not known.
ALTER TABLE campaign ADD COLUMN origin BLOB NOT NULL DEFAULT x'';
