"""Any bytes at all: what reads them refuses them in words, or takes them; it never raises."""

from pathlib import Path

import pytest

from tests.kit.packets import fuzz
from tests.kit.packets.targets import TARGETS

EXAMPLES = 250  # of each target


@pytest.mark.timeout(180)
@pytest.mark.parametrize("name", TARGETS)
def test_nothing_that_is_read_raises(name: str) -> None:
    fuzz.fuzz(name, examples=EXAMPLES, number=1)


def test_what_raises_is_found_made_small_and_kept(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "brittle").mkdir()
    (tmp_path / "brittle" / "sample").write_bytes(b"a sample")

    def brittle(data: bytes) -> None:
        assert not (len(data) > 3 and b"!" in data)

    monkeypatch.setattr(fuzz, "CORPUS", tmp_path)
    monkeypatch.setattr(fuzz, "TARGETS", {"brittle": brittle})
    with pytest.raises(AssertionError):
        fuzz.fuzz("brittle", examples=1_000, number=1)
    (crash,) = (tmp_path / "brittle").glob("crash-*")
    assert 4 <= len(crash.read_bytes()) <= len(b"a sample!")
    with pytest.raises(AssertionError):
        fuzz.fuzz("brittle", examples=0, number=1)  # from now on it is tried first
