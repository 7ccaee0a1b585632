"""Numbers in the task server's messages and commands that mean something of their own.

The wire contract (``dialects/messages.md``, ``dialects/control.md``) explains them.
"""

UNKNOWN_POSITION = 65535  # TASK_STATUS.queue_position
UNKNOWN_PROGRESS = 255  # TASK_STATUS.progress
SHARES_ID = 1  # TASK_QUEUE_STATUS.flags
NO_HEARTBEAT = 0xFFFFFFFF  # TASK_QUEUE_STATUS.heartbeat_age: none came
FINISHED = 1.0  # param4 of REQUEST_MESSAGE(TASK_STATUS, 0): finished tasks
PAGE = 16  # waiting or finished tasks that one such request returns
EPOCHS = 1 << 24  # halt epochs that a float32 parameter tells apart
