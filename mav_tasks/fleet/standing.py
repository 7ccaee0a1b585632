"""What a gateway may do with the vehicles that it holds: one table, for each state and event.

A gateway holds vehicles as long as it renews its lease in the database. If it cannot, it stops
them while they are still its own; after that it sends them nothing, because another gateway may
have them. ``standing_after`` is the only place that says so.
"""

from enum import Enum, auto


class Standing(Enum):
    """A gateway's state in its fleet."""

    OUT = "not in the fleet"  # it holds no vehicle
    HOLDER = "holder"  # its lease is renewed: it drives its vehicles
    STOPPING = "stopping"  # not renewed in time: it stops them; nobody else can have them yet
    SILENT = "silent"  # others may have them: it sends them nothing
    EVICTED = "evicted"  # others may have them for good: it must join again


class LeaseEvent(Enum):
    """What may happen to a gateway's lease."""

    JOINED = auto()  # the database has given it a new epoch
    RENEWED = auto()  # an answer that extends its trust beyond now
    TRUST_ENDED = auto()  # the time for which it may trust its last renewal, less a margin
    TERM_ENDED = auto()  # after this time another gateway may evict it
    REFUSED = auto()  # the database says that its epoch is not the present one
    LEFT = auto()  # it leaves the fleet in order: its vehicles stand, and are free


class Effect(Enum):
    """What the gateway does to its vehicles."""

    STOP = auto()  # zero and HOLD to each of them; their tasks are paused
    PAUSE = auto()  # their tasks are paused, without a packet to them
    RESUME = auto()  # it still holds them: tasks that were paused for that may resume
    DROP = auto()  # forget them and their tasks, without a packet to them


S, E = Standing, LeaseEvent

#: state and event -> the next state, and the effects; a pair that is missing changes nothing
TABLE: dict[tuple[Standing, LeaseEvent], tuple[Standing, tuple[Effect, ...]]] = {
    (S.OUT, E.JOINED): (S.HOLDER, ()),
    (S.HOLDER, E.TRUST_ENDED): (S.STOPPING, (Effect.STOP,)),
    # its process or machine stood still
    (S.HOLDER, E.TERM_ENDED): (S.SILENT, (Effect.PAUSE,)),
    (S.HOLDER, E.REFUSED): (S.EVICTED, (Effect.DROP,)),
    (S.HOLDER, E.LEFT): (S.OUT, (Effect.STOP, Effect.DROP)),
    (S.STOPPING, E.RENEWED): (S.HOLDER, (Effect.RESUME,)),
    (S.STOPPING, E.TERM_ENDED): (S.SILENT, ()),
    (S.STOPPING, E.REFUSED): (S.EVICTED, (Effect.DROP,)),
    (S.STOPPING, E.LEFT): (S.OUT, (Effect.DROP,)),
    # the database accepted its epoch: nobody has evicted it, so nobody else had its vehicles
    (S.SILENT, E.RENEWED): (S.HOLDER, (Effect.RESUME,)),
    (S.SILENT, E.REFUSED): (S.EVICTED, (Effect.DROP,)),
    (S.SILENT, E.LEFT): (S.OUT, (Effect.DROP,)),
    (S.EVICTED, E.JOINED): (S.HOLDER, ()),
    (S.EVICTED, E.LEFT): (S.OUT, ()),
}

#: states in which a gateway may send its vehicles what stops them
MAY_STOP = frozenset({S.HOLDER, S.STOPPING})


def standing_after(standing: Standing, event: LeaseEvent) -> tuple[Standing, tuple[Effect, ...]]:
    """Return the state after an event, and the effects in their order."""
    return TABLE.get((standing, event), (standing, ()))
