"""Makes a secret of 32 bytes: random, from hex digits, or from a passphrase.

The two derivations from passphrases are those of ground stations, so that one passphrase gives the
same secret at both ends. A listener can try passphrases on a signature offline, millions of them
with plain SHA-256: so short passphrases are refused.
"""

import hashlib
import re
import secrets

from mav_tasks.basics.errors import KeyRingError
from mav_tasks.mavlink.signing import KEY_LENGTH

SHA256 = "sha256"  # QGroundControl 5.0, MAVProxy
PBKDF2 = "pbkdf2"  # QGroundControl after 5.0
PASSPHRASES = (SHA256, PBKDF2)
HEX = "hex"
GENERATED = "generated"
DERIVATIONS = (*PASSPHRASES, HEX, GENERATED)

PBKDF2_SALT = b"QGroundControl-MAVLink-Signing-v1"  # QGroundControl's own
PBKDF2_ITERATIONS = 600_000
LEAST_PASSPHRASE = 8  # characters; QGroundControl's
_DIGITS = re.compile(rf"[0-9a-fA-F]{{{2 * KEY_LENGTH}}}")


def generated() -> bytes:
    return secrets.token_bytes(KEY_LENGTH)


def from_hex(text: str) -> bytes:
    """Return the secret of 64 hexadecimal digits; raise KeyRingError for another text."""
    if not _DIGITS.fullmatch(text):
        raise KeyRingError(f"expected {2 * KEY_LENGTH} hexadecimal digits")
    secret = bytes.fromhex(text)
    if not any(secret):  # in SETUP_SIGNING it means "no key"
        raise KeyRingError("all digits are zero: not a valid key")
    return secret


def from_passphrase(passphrase: str, how: str) -> bytes:
    """Return the secret of a passphrase; raise KeyRingError if it is too short.

    ``how`` is one of PASSPHRASES.
    """
    if len(passphrase) < LEAST_PASSPHRASE:
        raise KeyRingError(f"a passphrase has at least {LEAST_PASSPHRASE} characters")
    data = passphrase.encode("utf-8", "surrogateescape")
    if how == SHA256:
        return hashlib.sha256(data).digest()
    return hashlib.pbkdf2_hmac("sha256", data, PBKDF2_SALT, PBKDF2_ITERATIONS, KEY_LENGTH)
