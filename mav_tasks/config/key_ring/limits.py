"""The limits of one key, beside those of its role: as plain values, and in words. Pure."""

from collections.abc import Mapping

from mav_tasks.basics.errors import KeyRingError, SettingError
from mav_tasks.config.setting_keys.key import declared_in
from mav_tasks.config.setting_keys.literals import literal
from mav_tasks.config.settings import Limits

#: what the settings declare about each limit, by its name
LIMITS = declared_in(Limits)


def limits_of(name: str, plain: Mapping[str, object]) -> Limits | None:
    """Return the limits of the key of this name, by plain values; None if there are none.

    Raise KeyRingError, with the names of key and limit, if a value is invalid.
    """
    kept = {}
    for limit, value in plain.items():
        try:
            kept[limit] = LIMITS[limit].shape.kept(value)
        except SettingError as error:
            raise KeyRingError(f"key {name}: {limit}: {error}") from None
    return Limits(**kept) if kept else None


def plain_limits(limits: object) -> dict[str, object]:
    """Return a key's limits as plain values by name, without those that limit nothing."""
    return {
        name: key.shape.plain(getattr(limits, name))
        for name, key in LIMITS.items()
        if limits is not None and getattr(limits, name) != getattr(Limits(), name)
    }


def limits_in_words(limits: object) -> str:
    """Return a key's limits as a text, "" for none."""
    words = []
    for name, value in plain_limits(limits).items():
        unit = LIMITS[name].shape.unit
        words.append(f"{name} {literal(value)}{f' {unit}' if unit else ''}")
    return ", ".join(words)
