-- The tables that every kind of database has; sqlite.sql and postgresql.sql add their own.
-- {BIG}, {REAL}, {ID} and {EPOCH} are the kind's words. Times are UTC seconds, texts are rows of codec.py.

-- the server that opened the database last
CREATE TABLE writer (
    one INTEGER PRIMARY KEY CHECK (one = 1),
    epoch {BIG} NOT NULL,
    host TEXT NOT NULL,
    pid {BIG} NOT NULL,
    since {REAL} NOT NULL
);
INSERT INTO writer (one, epoch, host, pid, since) VALUES (1, 0, '', 0, 0);

-- fleet: names the store over its copies and moves, and with it the halt record beside it; '': no name yet
CREATE TABLE meta (
    one INTEGER PRIMARY KEY CHECK (one = 1),
    fleet TEXT NOT NULL DEFAULT '',
    next_id {BIG} NOT NULL,
    last_number {BIG} NOT NULL,
    last_write {REAL},
    ended_well INTEGER NOT NULL,
    signed_until {BIG} NOT NULL DEFAULT 0
);
INSERT INTO meta (one, next_id, last_number, ended_well) VALUES (1, 1, 0, 1);

CREATE TABLE formats (id {ID} PRIMARY KEY, names TEXT NOT NULL);

-- A submission's event is in its task's row: number and submitted. assigned: the last vehicle, if it was chosen again.
CREATE TABLE tasks (
    id {BIG} PRIMARY KEY,
    number {BIG} NOT NULL,
    vehicle {BIG} NOT NULL,
    state INTEGER NOT NULL,
    changed_at {REAL} NOT NULL,
    submitted TEXT NOT NULL,
    changed TEXT,
    modified TEXT,
    advanced TEXT,
    assigned TEXT{EPOCH}
);
CREATE INDEX finished ON tasks (changed_at) WHERE state >= 9;

CREATE TABLE journal (
    number {BIG} PRIMARY KEY,
    utc {REAL} NOT NULL,
    kind TEXT NOT NULL,
    task_id {BIG},
    vehicle {BIG},
    body TEXT NOT NULL{EPOCH}
);
CREATE INDEX of_task ON journal (task_id) WHERE task_id IS NOT NULL;
CREATE INDEX of_kind ON journal (kind, task_id);

-- may_arm: 0 after a client disarmed the vehicle
CREATE TABLE vehicles (
    vehicle {BIG} PRIMARY KEY,
    paused INTEGER,
    uid TEXT,
    speed {REAL},
    halt_epoch {BIG},
    may_arm INTEGER,
    halt_reason INTEGER,
    halted_utc {REAL}
);

CREATE TABLE plans (
    vehicle {BIG} NOT NULL,
    kind INTEGER NOT NULL,
    plan_id {BIG} NOT NULL,
    source TEXT NOT NULL,
    PRIMARY KEY (vehicle, kind)
);

CREATE TABLE parameters (name TEXT PRIMARY KEY, value {REAL});

-- times of signatures, in 10 µs since 2015; keys by their fingerprints
CREATE TABLE signatures (
    key TEXT NOT NULL,
    link_id INTEGER NOT NULL,
    system_id INTEGER NOT NULL,
    component_id INTEGER NOT NULL,
    timestamp {BIG} NOT NULL,
    PRIMARY KEY (key, link_id, system_id, component_id)
);
