"""The lines of a decision record: all inputs of an engine, and its outputs.

A record is a gzip file of JSON lines; ``zcat`` shows it. The first line is an object: the number of
this format, the writer's version and machine, ``now`` at the start in monotonic seconds, settings,
restored state, and the row formats (``store/codec``). Each following line is an array::

    ["task", row]                           a restored task; the first line has their number
    ["packets", now, link, [[peer, data in base64], ...], [arrival, ...]]  the last if any has one
    ["at once", now, [link, ...], ...]      packets of several links, each from ``link`` on
    ["deadline", now]                       a call of Engine.handle_deadline
    ["link", now, ...], ["peer", ...]       the other inputs, with their fields in order
    ["vehicles taken", now, [vehicle, ...], restored state, [row of a task, ...]]
    ["keys", now, [[name, role, ...], ...]] the keys with fingerprints, without secrets: a replay
                                            needs the key ring
    ["out", now, packets, digest, [row, ...]]   the engine's output of one turn: number of packets,
                                            BLAKE2b of all of them, and the events
    ["end", why, lines, digest]             the end mark; missing after a crash

Floats are exact (the shortest text that reads back as the same bits; NaN, Infinity and -0.0 as
Python's JSON writes them), and integers stay integers. A peer is text, a number, or an array of
them, which stands for a tuple. A record has no other clock, no path and no process-dependent hash.
"""

from binascii import a2b_base64, b2a_base64
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import asdict
from hashlib import blake2b
from json import JSONEncoder
from typing import Any, assert_never, get_args

from mav_tasks.config.settings import Limits
from mav_tasks.engine import inputs
from mav_tasks.engine.inputs import Input, LinkSide, Outgoing, Packets
from mav_tasks.mavlink.signing import Key
from mav_tasks.recording.surroundings import restored_of, restored_to_json, settings_of
from mav_tasks.store.codec import Decoder, Encoder, format_of
from mav_tasks.tasks.events import Event
from mav_tasks.tasks.lifecycle import TaskState
from mav_tasks.tasks.task import Task

FORMAT = 3
MAGIC = "mav-tasks record"  # the key in the first line whose value is the format's number
MISSING = b"?"  # stands for a secret
DIGEST = 8  # bytes of the digest of one turn's packets
MOST_WAYS = 10_000  # cached JSON texts of links and peers

EVENTS: dict[str, type] = {kind.__name__: kind for kind in get_args(Event)}
ROWS = format_of(*EVENTS.values(), Task)
_TASKS = Decoder(ROWS, is_exact=True)

# The check for circular references costs a dict entry for each list; our values have none.
dumps = JSONEncoder(separators=(",", ":"), check_circular=False).encode


class Unwritable(ValueError):
    """A value that a record cannot hold; the text names it."""


class LineWriter:
    """Makes the lines of a record, without newlines."""

    def __init__(self) -> None:
        self._encoder = Encoder(is_exact=True)
        self._ways: dict[tuple[str, Hashable], bytes] = {}

    def task(self, task: Task) -> str:
        return dumps(["task", self._encoder.row(task, offset=0.0)])

    def taken(self, item: Input | None, *, now: float) -> str:
        """Return the line of an input, or (None) of a deadline; raise Unwritable for a peer."""
        if isinstance(item, inputs.VehiclesTaken):
            rows = [self._encoder.row(task, offset=0.0) for task in item.restored.tasks]
            state = restored_to_json(item.restored)
            return dumps(["vehicles taken", now, item.vehicles, state, rows])
        return dumps(_input_to_json(item, now))

    def given(self, packets: Sequence[Outgoing], events: Sequence[Event], *, now: float) -> str:
        """Return the line of the engine's output of one turn."""
        rows = [[type(event).__name__, *self._encoder.row(event, offset=0.0)] for event in events]
        return dumps(["out", now, len(packets), self._digest(packets), rows])

    def _digest(self, packets: Sequence[Outgoing]) -> str:
        parts: list[bytes] = []
        for link, peer, data, is_first, _ in packets:
            parts += (self._way(link, peer), b"!" if is_first else b".", data)
        return blake2b(b"".join(parts), digest_size=DIGEST).hexdigest()

    def _way(self, link: str, peer: Hashable) -> bytes:
        way = self._ways.get((link, peer))
        if way is None:
            if len(self._ways) >= MOST_WAYS:
                self._ways.clear()
            way = self._ways[link, peer] = dumps([link, _peer_to_json(peer)]).encode()
        return way


def input_of(line: Sequence[Any]) -> Input | None:
    """Return the input of a line, None for a deadline.

    Raise KeyError, TypeError or ValueError if the line is no input.
    """
    kind, _, *values = line
    match kind:
        case "deadline":
            return None
        case "packets":
            return _packets_of(*values)
        case "at once":
            return inputs.AtOnce(tuple(_packets_of(*each) for each in values))
        case "link":
            link, side, up, peers, *rest = values
            return inputs.LinkChanged(link, LinkSide[side], up, tuple(map(peer_of, peers)), *rest)
        case "keys":
            (keys,) = values
            return inputs.KeysChanged(tuple(_key_of(*each) for each in keys))
        case "peer":
            link, peer, up = values
            return inputs.PeerChanged(link, peer_of(peer), up)
        case "congestion":
            link, peer, is_congested = values
            return inputs.Congestion(link, peer_of(peer), is_congested)
        case "settings":
            (settings,) = values
            return inputs.SettingsChanged(settings_of(settings))
        case "vehicles taken":
            vehicles, state, rows = values
            tasks = tuple(_TASKS.values(Task, rows, offset=0.0))
            return inputs.VehiclesTaken(tuple(vehicles), restored_of(state, tasks))
        case "vehicles gone":
            (vehicles,) = values
            return inputs.VehiclesGone(tuple(vehicles))
        case "fleet":
            (holders,) = values
            return inputs.FleetChanged(tuple((vehicle, name) for vehicle, name in holders))
        case "tasks elsewhere":
            (states,) = values
            known = ((task, None if state is None else TaskState(state)) for task, state in states)
            return inputs.TasksElsewhere(tuple(known))
        case "parameters":
            (pairs,) = values
            return inputs.ParametersChanged(tuple((name, value) for name, value in pairs))
        case _ if kind in _SIMPLE:
            return _SIMPLE[kind](*values)
        case _:
            raise ValueError(f"{kind!r} is unknown to this version")


def described(row: Sequence[Any]) -> str:
    """Return an event's row as text, with the names of its fields."""
    name, *values = row
    return f"{name}({', '.join(f'{p}={v!r}' for p, v in zip(ROWS[name], values, strict=True))})"


_SIMPLE: Mapping[str, Callable[..., Input]] = {
    "committed": inputs.Committed,
    "halts kept": inputs.HaltsKept,
    "store failed": inputs.StoreFailed,
    "halt not stored": inputs.HaltNotStored,
    "lease": inputs.LeaseChanged,
    "ids": inputs.IdsGranted,
    "nonce taken": inputs.NonceTaken,
    "wall clock": inputs.WallClock,
    "shutdown": inputs.Shutdown,
}


def _input_to_json(item: Input | None, now: float) -> list[Any]:
    assert not isinstance(item, inputs.VehiclesTaken), "it has tasks, which need the encoder"
    match item:
        case None:
            return ["deadline", now]
        case Packets():
            return ["packets", now, *_packets_to_json(item)]
        case inputs.AtOnce(packets=packets):
            return ["at once", now, *map(_packets_to_json, packets)]
        case inputs.LinkChanged():
            peers = [_peer_to_json(peer) for peer in item.peers]
            end = [item.is_local, item.is_stream, item.takes_unsigned, item.key, item.capacity]
            return ["link", now, item.link, item.side.name, item.up, peers, *end]
        case inputs.KeysChanged(keys=keys):
            return ["keys", now, [*map(_key_to_json, keys)]]
        case inputs.PeerChanged(link=link, peer=peer, up=up):
            return ["peer", now, link, _peer_to_json(peer), up]
        case inputs.Congestion(link=link, peer=peer, is_congested=is_congested):
            return ["congestion", now, link, _peer_to_json(peer), is_congested]
        case inputs.SettingsChanged(settings=settings):
            return ["settings", now, asdict(settings)]
        case inputs.Committed(through=through):
            return ["committed", now, through]
        case inputs.HaltsKept(through=through):
            return ["halts kept", now, through]
        case inputs.StoreFailed(text=text):
            return ["store failed", now, text]
        case inputs.HaltNotStored(vehicle=vehicle):
            return ["halt not stored", now, vehicle]
        case inputs.LeaseChanged(move_until=move_until, stop_until=stop_until):
            return ["lease", now, move_until, stop_until]
        case inputs.VehiclesGone(vehicles=vehicles):
            return ["vehicles gone", now, vehicles]
        case inputs.FleetChanged(holders=holders):
            return ["fleet", now, holders]
        case inputs.TasksElsewhere(states=states):
            return ["tasks elsewhere", now, states]
        case inputs.ParametersChanged(values=values):
            return ["parameters", now, values]
        case inputs.IdsGranted(first=first, count=count):
            return ["ids", now, first, count]
        case inputs.NonceTaken(task_id=task_id, known=known, payload=payload):
            return ["nonce taken", now, task_id, known, payload]
        case inputs.WallClock(offset=offset):
            return ["wall clock", now, offset]
        case inputs.Shutdown():
            return ["shutdown", now]
        case _:
            assert_never(item)


def _packets_to_json(item: Packets) -> list[Any]:
    pairs = [[_peer_to_json(peer), _base64(data)] for peer, data in item.datagrams]
    return [item.link, pairs, *([list(item.arrived)] if item.arrived else [])]


def _packets_of(link: str, datagrams: Sequence[Any], arrived: Sequence[float] = ()) -> Packets:
    pairs = [(peer_of(peer), a2b_base64(data, strict_mode=True)) for peer, data in datagrams]
    if arrived and len(arrived) != len(pairs):
        raise ValueError("arrivals and datagrams differ in number")
    return Packets(link, pairs, arrived)


def _key_to_json(key: Key) -> list[Any]:
    own = [asdict(key.limits)] if isinstance(key.limits, Limits) else []
    return [key.name, key.role, key.fingerprint, bool(key.secret), *own]


def _key_of(name: str, role: str, fingerprint: str, is_in_use: bool, own: Any = None) -> Key:
    """Return a key with MISSING for its secret, or no secret if the key is revoked."""
    limits = None if own is None else Limits(**own | {"tasks": tuple(own["tasks"])})
    return Key(name, MISSING if is_in_use else b"", role, fingerprint, limits)


def _base64(data: bytes) -> str:
    return b2a_base64(data, newline=False).decode("ascii")


def _peer_to_json(peer: Hashable) -> Hashable:
    parts = peer if isinstance(peer, tuple) else (peer,)
    if not all(type(part) in (str, int) for part in parts):
        raise Unwritable(f"unknown kind of peer: {peer!r}")
    return peer  # JSON writes a tuple as an array


def peer_of(value: Any) -> Hashable:
    if isinstance(value, list):
        return tuple(map(_plain, value))
    return _plain(value)


def _plain(value: Any) -> str | int:
    if type(value) not in (str, int):
        raise TypeError(f"no peer: {value!r}")
    return value  # type: ignore[no-any-return]
