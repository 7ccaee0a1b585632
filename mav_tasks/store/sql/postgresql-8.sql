-- From schema 7: events are counted by their kind.
CREATE INDEX of_kind ON journal (kind, task_id);
DROP INDEX of_no_task;
