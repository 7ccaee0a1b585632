"""Tokens: kept as hashes in a private file; each fault of the file is named."""

import json
import os
from pathlib import Path

import pytest

from mav_tasks.web import tokens
from mav_tasks.web.tokens import TokenError, Tokens


def test_a_token_is_kept_as_a_hash_in_a_private_file(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "tokens.json"
    text = tokens.add(path, "anna", "operator")
    assert len(text) >= 40
    assert text not in path.read_text(encoding="utf-8")
    assert path.stat().st_mode & 0o777 == 0o600
    assert path.parent.stat().st_mode & 0o777 == 0o700
    found = Tokens(path).of_text(text)
    assert found is not None
    assert (found.name, found.role) == ("anna", "operator")
    assert tokens.add(path, "ben", "observer") != text


def test_a_running_process_sees_a_change_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "tokens.json"
    kept = Tokens(path)
    assert kept.of_text("x") is None
    text = tokens.add(path, "anna", "operator")
    found = kept.of_text(text)
    assert found is not None
    assert kept.is_valid(found)
    tokens.revoke(path, "anna")
    assert kept.of_text(text) is None
    assert not kept.is_valid(found)
    tokens.add(path, "anna", "operator")
    assert not kept.is_valid(found)  # another token of that name
    path.unlink()
    assert kept.of_text(text) is None


def test_names_roles_and_copies_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "tokens.json"
    for name in ("", "a b", "x" * 33, "<b>", "ä\n"):
        with pytest.raises(TokenError, match="expected letters"):
            tokens.add(path, name, "operator")
    with pytest.raises(TokenError, match="role 'root': expected one of observer"):
        tokens.add(path, "anna", "root")
    with pytest.raises(TokenError, match="a user without a token"):
        tokens.add(path, "local", "operator")
    tokens.add(path, "anna", "operator")
    with pytest.raises(TokenError, match="there is a token anna already"):
        tokens.add(path, "anna", "observer")
    with pytest.raises(TokenError, match="there is no token ben"):
        tokens.revoke(path, "ben")


@pytest.mark.parametrize(
    "text",
    [
        *("", "[]", "{}", '{"tokens": [1]}', '{"tokens": [{"name": 1}]}'),
        '{"tokens": [{"name": "a", "role": "operator", "digest": 1, "added": ""}]}',
        '{"tokens": [{"name": "a", "role": "operator", "digest": "\u00e4", "added": ""}]}',
    ],
)
def test_a_damaged_file_is_named_and_lets_nobody_in(tmp_path: Path, text: str) -> None:
    path = tmp_path / "tokens.json"
    path.touch(mode=0o600)
    path.write_text(text, encoding="utf-8")
    with pytest.raises(TokenError, match=r"tokens\.json"):
        tokens.load(path)
    assert Tokens(path).of_text("x") is None
    with pytest.raises(TokenError):
        tokens.add(path, "anna", "operator")
    assert path.read_text(encoding="utf-8") == text


def test_a_file_that_others_can_read_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "tokens.json"
    text = tokens.add(path, "anna", "operator")
    os.chmod(path, 0o644)  # noqa: PTH101  # the mode is the point
    with pytest.raises(TokenError, match="chmod 600"):
        tokens.load(path)
    assert Tokens(path).of_text(text) is None


def test_an_unknown_role_in_the_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "tokens.json"
    tokens.add(path, "anna", "operator")
    stored = json.loads(path.read_text(encoding="utf-8"))
    stored["tokens"][0]["role"] = "root"
    path.write_text(json.dumps(stored), encoding="utf-8")
    with pytest.raises(TokenError, match="no role 'root'"):
        tokens.load(path)
