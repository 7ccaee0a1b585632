from mav_tasks.client import wire
from mav_tasks.client.idempotency import LONGEST, numbers_of
from mav_tasks.tasks.task import MAX_NONCE

KEYS = 200_000


def test_a_key_is_the_same_numbers_in_every_process() -> None:
    assert numbers_of("survey of field 3", label="survey") == (585_924_458, 832_964_382)


def test_another_label_is_another_content_of_the_same_key() -> None:
    one, other = (numbers_of("survey", label=label) for label in ("", "first"))
    assert one.nonce == other.nonce
    assert one.check != other.check


def test_key_and_label_are_not_mixed_up() -> None:
    assert numbers_of("a b", label="c").check != numbers_of("a", label="b c").check


def test_keys_that_share_a_nonce_differ_in_the_check() -> None:
    """Of so many keys some 19 pairs share a nonce: the server tells them apart by the rest."""
    by_nonce: dict[int, list[int]] = {}
    for number in range(KEYS):
        nonce, check = numbers_of(f"key {number}", label="")
        by_nonce.setdefault(nonce, []).append(check)
    shared = [checks for checks in by_nonce.values() if len(checks) > 1]
    assert 5 < len(shared) < 40
    assert all(len(set(checks)) == len(checks) for checks in shared)


def test_all_numbers_can_be_sent() -> None:
    for key in ("x", "é" * LONGEST, "\n", "0"):
        nonce, check = numbers_of(key, label="")
        assert 0 < nonce <= MAX_NONCE
        wire.check_nonce(nonce)
        wire.check_check(check)
