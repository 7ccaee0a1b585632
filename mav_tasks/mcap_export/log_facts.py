"""Length and digest of a telemetry log, to check a restored log against."""

from hashlib import blake2b
from typing import Any

DIGEST = 16  # bytes


class LogFacts:
    """Counts and digests the pieces of a log, in their order."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._pieces = 0
        self._digest: Any = blake2b(digest_size=DIGEST)  # hashlib's type has no public name
        self.size = 0  # bytes

    def __repr__(self) -> str:
        return f"LogFacts({self._name}, {self._pieces} pieces, {self.size} bytes)"

    def add(self, data: bytes) -> None:
        """Note the next piece."""
        self._pieces += 1
        self.size += len(data)
        self._digest.update(data)

    def metadata(self) -> dict[str, str]:
        """Return the contents of the metadata record."""
        return {
            "file": self._name,
            "pieces": str(self._pieces),
            "bytes": str(self.size),
            "blake2b": self._digest.hexdigest(),
        }
