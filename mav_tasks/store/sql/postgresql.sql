-- What a PostgreSQL database has beside tables.sql.

UPDATE meta SET fleet = gen_random_uuid()::text;

-- Tasks of a fleet: ids do not increase with the number of the submission; run_after is the task before, perhaps another gateway's.
ALTER TABLE tasks ADD COLUMN run_after BIGINT;
CREATE INDEX by_number ON tasks (number);
CREATE INDEX not_over ON tasks (vehicle) WHERE state < 9;
CREATE INDEX expected ON tasks (run_after) WHERE run_after IS NOT NULL;

-- Gateways that share a fleet (fleet/io/lease_database.py). epoch 0: not in the fleet; backend: of the session that asked last.
-- hears: vehicles that it hears and does not hold. system_id 0: not known.
CREATE TABLE gateways (
    number INTEGER GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    name TEXT NOT NULL UNIQUE,
    epoch BIGINT NOT NULL DEFAULT 0,
    renewals BIGINT NOT NULL DEFAULT 0,
    backend INTEGER NOT NULL DEFAULT 0,
    host TEXT NOT NULL DEFAULT '',
    port INTEGER NOT NULL DEFAULT 0,
    machine TEXT NOT NULL DEFAULT '',
    pid BIGINT NOT NULL DEFAULT 0,
    since DOUBLE PRECISION NOT NULL DEFAULT 0,
    hears BIGINT[] NOT NULL DEFAULT '{}',
    system_id INTEGER NOT NULL DEFAULT 0
);
CREATE SEQUENCE gateway_epochs AS BIGINT;

-- gateway NULL: free. number: of the takeover, a fence that only rises.
-- lead: seconds by which the holder signs ahead of its clock, as of a time: a fence at the vehicle
CREATE TABLE holdings (
    vehicle BIGINT PRIMARY KEY,
    gateway INTEGER REFERENCES gateways,
    number BIGINT NOT NULL,
    lead DOUBLE PRECISION NOT NULL DEFAULT 0,
    lead_utc DOUBLE PRECISION NOT NULL DEFAULT 0
);
CREATE INDEX held_by ON holdings (gateway) WHERE gateway IS NOT NULL;

-- authenticates the pings between gateways
CREATE TABLE gateway_secret (one INTEGER PRIMARY KEY CHECK (one = 1), secret TEXT NOT NULL);
INSERT INTO gateway_secret VALUES (1, gen_random_uuid()::text || gen_random_uuid()::text);

-- not in gateways: a write that hangs must not keep that gateway from its renewals
CREATE TABLE gateway_writes (
    gateway INTEGER PRIMARY KEY REFERENCES gateways,
    epoch BIGINT NOT NULL,
    written BIGINT NOT NULL
);

-- submissions to any vehicle (fleet_nonces.py)
CREATE TABLE nonces (
    key TEXT NOT NULL,
    system_id INTEGER NOT NULL,
    component_id INTEGER NOT NULL,
    nonce BIGINT NOT NULL,
    payload TEXT NOT NULL,
    task_id BIGINT NOT NULL,
    PRIMARY KEY (key, system_id, component_id, nonce)
);
CREATE INDEX of_nonce ON nonces (task_id);
