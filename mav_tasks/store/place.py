"""The place of a store: the text of ``--store``."""

import re

_PASSWORD = re.compile(r"(?<=://)([^:@/?]*):.*@")
_PARAMETER = re.compile(r"([?&])(?:ssl)?password=[^&]*&?")


def without_password(place: str) -> str:
    """Return a place for people, without a password.

    Of a URL that cannot be parsed more than the password may go: that may have any character.
    """
    return _PARAMETER.sub(r"\1", _PASSWORD.sub(r"\1@", place)).rstrip("?&")
