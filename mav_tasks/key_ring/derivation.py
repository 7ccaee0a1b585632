"""How a secret of 32 bytes comes about: by chance, as digits, or out of a passphrase.

Of passphrases the two ways that ground stations have, so that one passphrase gives the same secret
at both ends. A signature lets whoever hears it try passphrases at home, by the million with SHA-256
alone: a short one is none.
"""

import hashlib
import re
import secrets

from mav_tasks.errors import KeyRingError
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
    """Return a secret that nobody has."""
    return secrets.token_bytes(KEY_LENGTH)


def from_hex(text: str) -> bytes:
    """Return the secret that 64 hexadecimal digits are; KeyRingError."""
    if not _DIGITS.fullmatch(text):
        raise KeyRingError(f"expected {2 * KEY_LENGTH} hexadecimal digits")
    secret = bytes.fromhex(text)
    if not any(secret):  # SETUP_SIGNING means "none" by it
        raise KeyRingError("all digits are zero: that is no key")
    return secret


def from_passphrase(passphrase: str, how: str) -> bytes:
    """Return the secret of a passphrase; ``how`` is one of PASSPHRASES. KeyRingError."""
    if len(passphrase) < LEAST_PASSPHRASE:
        raise KeyRingError(f"a passphrase has at least {LEAST_PASSPHRASE} characters")
    data = passphrase.encode("utf-8", "surrogateescape")
    if how == SHA256:
        return hashlib.sha256(data).digest()
    return hashlib.pbkdf2_hmac("sha256", data, PBKDF2_SALT, PBKDF2_ITERATIONS, KEY_LENGTH)
