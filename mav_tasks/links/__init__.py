"""Links: sockets and serial lines that carry bytes to and from peers. ``parse_url`` opens each."""

from mav_tasks.links.link_limits import TO_CLIENTS, TO_VEHICLES, LinkLimits
from mav_tasks.links.url import LinkUrl, parse_url

__all__ = ["TO_CLIENTS", "TO_VEHICLES", "LinkLimits", "LinkUrl", "parse_url"]
