"""Leaves out of the new core that it asks a rover for a heartbeat before it takes it.

The rovers of a record answer what the old core asked, when it did. They do not answer this, and
show our mode before the new core would have asked for it: every record would part at its first
task, and nothing after that be compared. What a rover is taken on is shown by scenarios instead
(attacks/test_person_at_the_rover); here the last heartbeat counts, as it did for the old core.
"""

from mav_tasks.services.news import News
from mav_tasks.services.offboard import OffboardControl


def leave_out() -> None:
    """Take the last heartbeat for news, and ask for none, in this process from here on."""

    def shows(_news: News, _moment: float) -> bool:
        return True

    def asks_for_none(_control: OffboardControl) -> bool:
        return False

    setattr(News, "is_newer_than", shows)  # noqa: B010  # mypy takes no other function for it
    setattr(OffboardControl, "takes_heartbeat", asks_for_none)  # noqa: B010
