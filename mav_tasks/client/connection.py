"""A Session on a link."""

import asyncio
from collections.abc import Callable

from mav_tasks.basics.errors import LinkUrlError
from mav_tasks.client.calls import Call
from mav_tasks.client.link_driver import LinkDriver
from mav_tasks.client.session import Session
from mav_tasks.client.signatures import ClientSignatures
from mav_tasks.links.base import Link
from mav_tasks.links.link_limits import TO_CLIENTS
from mav_tasks.links.url import parse_url


class Connection(LinkDriver):
    """Runs a session on a link. Call ``turn`` after each request to the session."""

    def __init__(
        self,
        link: str | Link,
        make_session: Callable[[float], Session],
        *,
        signatures: ClientSignatures | None = None,
    ) -> None:
        """Open the link. Raise LinkUrlError or LinkOpenError if that fails."""
        opened = _open(link) if isinstance(link, str) else link
        self.session = make_session(asyncio.get_running_loop().time())
        super().__init__(opened, self.session, signatures=signatures)
        self.session.ask_for_rovers(now=self.now)
        self.begin()

    def __repr__(self) -> str:
        return f"Connection({self.link.name})"

    def settle(self, call: Call, *, is_answered: bool) -> None:
        """End a call: see ``Calls.settle``. The connection may be closed."""
        self.session.calls.settle(call, is_answered=is_answered, now=self.now)
        self.turn()

    def _on_up(self) -> None:
        self.session.greet()
        self.session.ask_for_rovers(now=self.now)


def _open(link: str) -> Link:
    url = parse_url(link)
    if url.options.key or url.options.unsigned is not None:
        raise LinkUrlError(f"link {link!r}: options after ? are for servers only")
    return url.open(limits=TO_CLIENTS)
