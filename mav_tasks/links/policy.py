"""What is asked of signatures on a link, by its URL and what holds for all links."""

from dataclasses import dataclass
from typing import Literal, Protocol

from mav_tasks.errors import InsecureLinkError, UsageError
from mav_tasks.links.url import LinkUrl, SerialUrl

Side = Literal["clients", "vehicles"]

NEARBY = "loopback"  # of ``unsigned``: where nobody else can be
MEANT = "say --insecure, or links.insecure = true, if that is meant"


@dataclass(frozen=True, slots=True)
class LinkPolicy:
    """What is asked of signatures on one link; ``key`` is the name of its own, "" for none."""

    takes_unsigned: bool = True
    key: str = ""


class Rules(Protocol):
    """What holds for all links."""

    @property
    def insecure(self) -> bool:
        """Whether other machines may reach a link unsigned."""

    @property
    def unsigned(self) -> str:
        """Where unsigned packets are taken: "loopback" or "nowhere"."""


def is_nearby(url: LinkUrl | SerialUrl) -> bool:
    """Whether nobody beyond this machine can dial a link.

    A serial line is a wire that the operator has chosen. A radio at its end is not seen from here:
    ``?unsigned=refuse``, and ``?key=`` for a rover's, are for that.
    """
    return isinstance(url, SerialUrl) or url.is_loopback


def policy_of(
    url: LinkUrl | SerialUrl, side: Side, rules: Rules, *, pushes_far: bool = False
) -> LinkPolicy:
    """Return what is asked on a link; ``pushes_far``: it speaks to other machines unasked.

    Its own key is the only one that counts on a link to vehicles: nothing else is taken there,
    unless its URL says so.
    """
    if url.unsigned is not None:
        return LinkPolicy(url.unsigned, url.key)
    if side == "vehicles" and url.key:
        return LinkPolicy(takes_unsigned=False, key=url.key)
    is_taken_here = rules.insecure or (is_nearby(url) and not pushes_far)
    return LinkPolicy(rules.unsigned == NEARBY and is_taken_here, url.key)


def check(url: LinkUrl | SerialUrl, side: Side, policy: LinkPolicy, rules: Rules) -> None:
    """Raise UsageError for a link on which nothing could be heard, or anybody."""
    is_open = rules.insecure or is_nearby(url)
    if side == "vehicles" and not policy.key and not is_open:
        raise InsecureLinkError(
            f"link {url} reaches beyond this machine and has no signing key: "
            f"anybody there could drive the vehicle; ?key=NAME gives it one; or {MEANT}"
        )
    if side == "vehicles" and not policy.key and not policy.takes_unsigned:
        raise UsageError(
            f"link {url} takes nothing unsigned, and has no key: ?key=NAME gives it one, "
            "?unsigned=allow does without"
        )
    if policy.takes_unsigned and not is_open:
        raise unsigned_beyond(f"link {url}")


def unsigned_beyond(what: str) -> InsecureLinkError:
    """Return the error for what reaches others and takes what nobody has signed."""
    return InsecureLinkError(
        f"{what} reaches beyond this machine and needs no signing key: "
        f"anybody there could drive the vehicle; {MEANT}"
    )
