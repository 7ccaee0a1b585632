"""Checks that the key ring has the keys that the links need."""

from mav_tasks.basics.errors import InsecureLinkError, KeyRingError, UsageError
from mav_tasks.config.key_ring.ring import KeyRing
from mav_tasks.config.settings import Links
from mav_tasks.links.config_check import ConfiguredLink, links_of
from mav_tasks.links.policy import MEANT


def check_keys(links: Links, ring: KeyRing | None, *, where: str) -> None:
    """Raise UsageError if a link's key is missing or of the wrong side, or no client could sign.

    ``ring``: None if there is no key ring. ``where``: the path of the key ring, for the message.
    """
    for link in links_of(links):
        if link.policy.key:
            _check_key(link, ring or KeyRing(), where)
        is_far = not link.url.is_nearby or link.pushes_far
        is_for_none = not any(key.role for key in (ring or KeyRing()).usable)
        if link.side == "clients" and is_far and is_for_none and not links.insecure:
            raise InsecureLinkError(
                f"link {link.url} reaches beyond this machine, but no client has a signing key: "
                f'add one with "mav-tasks keys add" (key ring {where}); or {MEANT}'
            )


def _check_key(link: ConfiguredLink, ring: KeyRing, where: str) -> None:
    try:
        key = ring.usable_key(link.policy.key)
    except KeyRingError as error:
        raise UsageError(f"link {link.url}: {error}, in {where}") from None
    if link.side == "clients" and not key.role:
        raise UsageError(
            f"link {link.url}: key {key.name} has role vehicle: clients may not use it"
        )
    if link.side == "vehicles" and key.role:
        raise UsageError(
            f"link {link.url}: key {key.name} has role {key.role}: packets to the rover could "
            "be replayed as that client's. Add a key with --role vehicle for the rover"
        )


def in_words(link: ConfiguredLink, *, has_ring: bool) -> str:
    """Return a link's signing policy for the startup line; "" if there is nothing to say."""
    own = f", key {link.policy.key}" if link.policy.key else ""
    if link.policy.takes_unsigned:
        return f", unsigned, too{own}" if has_ring else own
    return f", signed only{own}"
