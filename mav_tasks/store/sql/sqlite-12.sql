-- From schema 11: events are counted by their kind.
CREATE INDEX of_kind ON journal (kind, task_id);
