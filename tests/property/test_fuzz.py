"""Any bytes at all: what reads them refuses them in words, or takes them; it never raises.

The corpus comes first: a file in ``vectors/fuzz`` for each input that raised once.
"""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from tests.kit.packets.targets import TARGETS

CORPUS = Path(__file__).resolve().parents[1] / "vectors" / "fuzz"
LONGEST = 2_000  # bytes
EXAMPLES = 250  # of each target


def inputs(samples: list[bytes]) -> st.SearchStrategy[bytes]:
    """Return a strategy: bytes, and samples with pieces cut, duplicated, moved or replaced."""
    pieces = st.one_of(
        st.binary(max_size=12),
        st.text(max_size=8).map(lambda text: text.encode("utf-8", "replace")),
        st.sampled_from(samples).flatmap(
            lambda sample: st.tuples(
                st.integers(0, len(sample)), st.integers(0, min(60, len(sample)))
            ).map(lambda cut: sample[cut[0] : cut[0] + cut[1]])
        ),
        st.integers(-(2**70), 2**70).map(lambda number: str(number).encode()),
    )
    edit = st.tuples(st.floats(0, 1), st.integers(0, 40), pieces)

    def edited(sample: bytes, edits: list[tuple[float, int, bytes]]) -> bytes:
        for where, length, piece in edits:
            at = int(where * len(sample))
            sample = sample[:at] + piece + sample[at + length :]
        return sample[:LONGEST]

    changed = st.builds(edited, st.sampled_from(samples), st.lists(edit, min_size=1, max_size=6))
    return st.one_of(changed, changed, changed, st.binary(max_size=600))


@pytest.mark.timeout(180)
@pytest.mark.parametrize("name", TARGETS)
def test_nothing_that_is_read_raises(name: str) -> None:
    samples = [path.read_bytes() for path in sorted((CORPUS / name).iterdir())]
    for sample in samples:
        TARGETS[name](sample)

    @seed(1)
    @settings(
        max_examples=EXAMPLES,
        deadline=None,
        database=None,
        phases=(Phase.generate, Phase.shrink),
        suppress_health_check=list(HealthCheck),
    )
    @given(inputs(samples))
    def once(data: bytes) -> None:
        TARGETS[name](data)

    once()
