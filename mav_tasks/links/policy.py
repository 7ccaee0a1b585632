"""The signing policy of a link, from its URL and the settings for all links."""

from dataclasses import dataclass
from typing import Literal, Protocol

from mav_tasks.basics.errors import InsecureLinkError, UsageError
from mav_tasks.links.url import LinkUrl

Side = Literal["clients", "vehicles"]

NEARBY = "loopback"  # value of ``unsigned``: on links that other machines cannot reach
MEANT = "use --insecure, or links.insecure = true, to allow that"


@dataclass(frozen=True, slots=True)
class LinkPolicy:
    """The signing policy of one link; ``key`` is the name of the link's own key, "" for none."""

    takes_unsigned: bool = True
    key: str = ""


class Rules(Protocol):
    """The signing settings for all links."""

    @property
    def insecure(self) -> bool:
        """Whether other machines may reach a link without signing."""

    @property
    def unsigned(self) -> str:
        """Where unsigned packets are accepted: "loopback" or "nowhere"."""


def policy_of(url: LinkUrl, side: Side, rules: Rules, *, pushes_far: bool = False) -> LinkPolicy:
    """Return the signing policy of a link; ``pushes_far``: it pushes to other machines.

    A link to vehicles that has a key accepts only packets signed with that key, unless its URL
    allows unsigned packets.
    """
    if url.options.unsigned is not None:
        return LinkPolicy(url.options.unsigned, url.options.key)
    if side == "vehicles" and url.options.key:
        return LinkPolicy(takes_unsigned=False, key=url.options.key)
    is_taken_here = rules.insecure or (url.is_nearby and not pushes_far)
    return LinkPolicy(rules.unsigned == NEARBY and is_taken_here, url.options.key)


def check(url: LinkUrl, side: Side, policy: LinkPolicy, rules: Rules) -> None:
    """Raise UsageError for a link that could accept no packet, or packets from anybody."""
    is_open = rules.insecure or url.is_nearby
    if side == "vehicles" and not policy.key and not is_open:
        raise InsecureLinkError(
            f"link {url} reaches beyond this machine and has no signing key: "
            f"anybody there could drive the rover; add ?key=NAME; or {MEANT}"
        )
    if side == "vehicles" and not policy.key and not policy.takes_unsigned:
        raise UsageError(
            f"link {url} accepts no unsigned packets, but has no key: add ?key=NAME, "
            "or ?unsigned=allow"
        )
    if policy.takes_unsigned and not is_open:
        raise unsigned_beyond(f"link {url}")


def unsigned_beyond(what: str) -> InsecureLinkError:
    """Return the error for a link that other machines reach and that accepts unsigned packets."""
    return InsecureLinkError(
        f"{what} reaches beyond this machine and needs no signing key: "
        f"anybody there could drive the rover; {MEANT}"
    )
