"""Checks the links of a configuration before any is opened, and finds all faults.

``link_keys.py`` checks whether the keys exist.
"""

from collections.abc import Iterator
from typing import NamedTuple, Protocol

from mav_tasks.basics.errors import UsageError
from mav_tasks.links.endpoint import is_loopback, parse_endpoint
from mav_tasks.links.policy import LinkPolicy, Rules, Side, check, policy_of, unsigned_beyond
from mav_tasks.links.udp import UdpUrl
from mav_tasks.links.url import LinkUrl, parse_url

SIDES: tuple[Side, ...] = ("clients", "vehicles")


class LinkSettings(Rules, Protocol):
    """The links of a server as text, as in the settings."""

    @property
    def clients(self) -> tuple[str, ...]:
        """URLs."""

    @property
    def push(self) -> tuple[str, ...]:
        """``host:port`` of UDP."""

    @property
    def vehicles(self) -> tuple[str, ...]:
        """URLs."""


class ConfiguredLink(NamedTuple):
    side: Side
    url: LinkUrl
    policy: LinkPolicy
    pushes_far: bool = False  # whether it pushes to other machines


def links_of(asked: LinkSettings) -> list[ConfiguredLink]:
    """Return the links of a configuration without faults, clients' first."""
    pushing = pushing_url(asked)
    links: list[ConfiguredLink] = []
    for side in SIDES:
        for text in getattr(asked, side):
            url = parse_url(text)
            pushes = side == "clients" and url == pushing
            is_far = pushes and not all(map(_is_near, asked.push))
            links.append(
                ConfiguredLink(side, url, policy_of(url, side, asked, pushes_far=is_far), is_far)
            )
    return links


def pushing_url(asked: LinkSettings) -> LinkUrl | None:
    """Return the URL of the link that pushes to clients: the first that can; None if none can."""
    urls = map(parse_url, asked.clients)
    return next((url for url in urls if url.can_push), None)


def pushed_to(asked: LinkSettings) -> tuple[tuple[str, int], ...]:
    """Return the push addresses without those at which this server itself listens."""
    texts = (*asked.clients, *asked.vehicles)
    own = [url for url in map(parse_url, texts) if isinstance(url, UdpUrl) and url.kind == "udpin"]
    pushed = (parse_endpoint(text, what=f"--push {text}") for text in asked.push)
    return tuple(each for each in pushed if not any(url.hears(*each) for url in own))


def faults_of(asked: LinkSettings) -> list[tuple[str, UsageError]]:
    """Return all faults, each with the name of its field."""
    faults = list(_faults_of_words(asked))
    return faults or list(_faults_of_signing(asked))


def _faults_of_words(asked: LinkSettings) -> Iterator[tuple[str, UsageError]]:
    seen: set[LinkUrl] = set()
    for side in SIDES:
        for text in getattr(asked, side):
            try:
                url = parse_url(text)
            except UsageError as error:
                yield side, error
                continue
            if url in seen:
                yield side, UsageError(f"link {url} is given twice")
            seen.add(url)
    for text in asked.push:
        try:
            parse_endpoint(text, what=f"push {text!r}")
        except UsageError as error:
            yield "push", error


def _faults_of_signing(asked: LinkSettings) -> Iterator[tuple[str, UsageError]]:
    for link in links_of(asked):
        try:
            check(link.url, link.side, link.policy, asked)
        except UsageError as error:
            yield link.side, error
            continue
        if link.pushes_far and link.policy.takes_unsigned and not asked.insecure:
            far = next(text for text in asked.push if not _is_near(text))
            yield "push", unsigned_beyond(f"push {far}")


def _is_near(text: str) -> bool:
    return is_loopback(parse_endpoint(text, what=f"push {text!r}")[0])
