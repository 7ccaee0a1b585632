"""How far our control of a vehicle has come."""

from enum import Enum, auto


class Phase(Enum):
    #: it is not ours; nothing is sent
    IDLE = auto()
    #: a heartbeat is awaited that shows whose it is now
    LOOKING = auto()
    #: HOLD is asked for, to arm in it
    ASKING_HOLD = auto()
    #: arming is asked for, zeros are streamed
    ASKING_ARM = auto()
    #: armed in HOLD; zeros are streamed
    LEADING_IN = auto()
    #: our mode is asked for
    ASKING_MODE = auto()
    #: in our mode and seen armed: setpoints move it
    CONTROL = auto()
    #: standing, HOLD is asked for
    RELEASING = auto()
    #: HOLD seen after a release that disarms; disarming is asked for
    DISARMING = auto()
    #: STOP: zeros and HOLD until confirmed
    STOPPING = auto()


#: nothing of ours is under way that still has to come true
ENDED = frozenset({Phase.IDLE, Phase.RELEASING, Phase.STOPPING})
STREAMING = frozenset({Phase.ASKING_ARM, Phase.LEADING_IN, Phase.CONTROL})
