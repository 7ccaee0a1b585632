"""Inputs for the fuzz targets: the corpus, edited corpus files, and random bytes.

Hypothesis generates and shrinks them. A failing input becomes a file of the corpus, which is tried
first from then on.
"""

from pathlib import Path
from zlib import crc32

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from tests.kit.packets.targets import TARGETS, Target

CORPUS = Path(__file__).resolve().parents[2] / "vectors" / "fuzz"
LONGEST = 2_000  # bytes


def corpus_of(name: str) -> list[bytes]:
    """Return the files of a target, sorted by name."""
    return [path.read_bytes() for path in sorted((CORPUS / name).iterdir())]


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


def fuzz(name: str, *, examples: int, number: int) -> None:
    """Try the corpus of a target, then ``examples`` inputs. Raise what the target raises."""
    target = TARGETS[name]
    samples = corpus_of(name)
    for sample in samples:
        target(sample)
    _try(target, samples, examples=examples, number=number)


def _try(target: Target, samples: list[bytes], *, examples: int, number: int) -> None:
    failed: list[bytes] = []

    @seed(number)
    @settings(
        max_examples=examples,
        deadline=None,
        database=None,
        phases=(Phase.generate, Phase.shrink),
        suppress_health_check=list(HealthCheck),
    )
    @given(inputs(samples))
    def once(data: bytes) -> None:
        try:
            target(data)
        except Exception:
            failed[:] = [data]
            raise

    try:
        once()
    except Exception:
        if failed:  # the last one is the smallest
            keep(target.__name__, failed[0])
        raise


def keep(name: str, data: bytes) -> Path:
    """Write a failing input to the corpus; return its path."""
    path = CORPUS / name / f"crash-{crc32(data):08x}"
    path.write_bytes(data)
    return path
