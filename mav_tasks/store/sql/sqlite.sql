-- What a SQLite file has beside tables.sql.

-- random, new with each checkpoint: whether the file itself is still the one that was opened
ALTER TABLE writer ADD COLUMN beats INTEGER NOT NULL DEFAULT 0;
CREATE UNIQUE INDEX of_names ON formats (names);
