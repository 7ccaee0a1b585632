"""The gate's question for known vulnerabilities, with a pip-audit that says what a test wants."""

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[3]
PASSED, FAILED, SKIPPED = 0, 1, 75

LOCK = """# a comment
numpy==2.4.6 ; python_full_version < '3.12' \\
    --hash=sha256:aa
numpy==2.5.5 ; python_full_version >= '3.12' \\
    --hash=sha256:bb
Rich==15.0.0 \\
    --hash=sha256:cc
"""
#: stands for pip-audit: ANSWER is the vulnerabilities by pin, "unknown" for one that nobody knows
FAKE = """#!{python}
import json, os, sys, time
arguments = sys.argv[1:]
pins = open(arguments[arguments.index("-r") + 1]).read().split()
print(*pins, sep="\\n", file=open(os.environ["ASKED"], "a"))
time.sleep(float(os.environ.get("HANGS", "0")))
if os.environ.get("SAYS"):
    sys.exit(os.environ["SAYS"])
answer = json.loads(os.environ["ANSWER"])
def shown(pin):
    name, _, version = pin.partition("==")
    if answer.get(pin) == "unknown":
        return dict(name=name, skip_reason=name + " not found")
    return dict(name=name, version=version, vulns=answer.get(pin, []))
with open(arguments[arguments.index("--output") + 1], "w") as file:
    json.dump(dict(dependencies=[shown(pin) for pin in pins], fixes=[]), file)
sys.exit(1 if any(answer.values()) else 0)
"""
BAD = {"id": "PYSEC-2026-7", "fix_versions": ["15.0.1"], "aliases": ["CVE-2026-1"]}


class Done(NamedTuple):
    status: int
    text: str
    asked: set[str]


class Auditor:
    def __init__(self, folder: Path) -> None:
        self.lock, self.bin, self.asked = folder / "lock", folder / "bin", folder / "asked"
        for made in (self.lock, self.bin):
            made.mkdir()
        (self.lock / "requirements.txt").write_text(LOCK, encoding="utf-8")
        (self.lock / "without_dependencies.txt").write_text("MAVProxy==1.8.75\n", encoding="utf-8")
        self.accept("")
        command = self.bin / "pip-audit"
        command.write_text(FAKE.format(python=sys.executable), encoding="utf-8")
        command.chmod(0o755)

    def accept(self, text: str) -> None:
        (self.lock / "accepted.toml").write_text(text, encoding="utf-8")

    def run(self, answer: Any = None, **variables: str) -> Done:
        done = subprocess.run(
            [sys.executable, str(ROOT / "tools" / "audit.py"), str(self.lock)],
            capture_output=True,
            text=True,
            timeout=30,
            check=False,
            env={
                "PATH": str(self.bin),
                "ASKED": str(self.asked),
                "ANSWER": json.dumps(answer or {}),
                **variables,
            },
        )
        assert done.stderr == ""
        asked = set(self.asked.read_text("utf-8").split()) if self.asked.exists() else set()
        return Done(done.returncode, done.stdout, asked)


@pytest.fixture
def auditor(tmp_path: Path) -> Auditor:
    return Auditor(tmp_path)


def test_all_that_is_locked_is_asked_about_also_for_other_pythons(auditor: Auditor) -> None:
    done = auditor.run()
    assert (done.status, done.text) == (PASSED, "")
    assert done.asked == {"numpy==2.4.6", "numpy==2.5.5", "rich==15.0.0", "mavproxy==1.8.75"}


ACCEPTED = '[[accepted]]\nid = "{}"\nreason = "we never draw that"\n'
ANOTHER = BAD | {"id": "PYSEC-2026-8", "aliases": []}
VULNERABLE = "vulnerable: rich 15.0.0: PYSEC-2026-7, CVE-2026-1, fixed in 15.0.1\n"


def test_a_vulnerability_fails_by_name_unless_one_lives_with_it(auditor: Auditor) -> None:
    for accepted, answer, status, words in (
        ("", {"rich==15.0.0": [BAD]}, FAILED, VULNERABLE),
        ("PYSEC-2026-7", {"rich==15.0.0": [BAD]}, PASSED, "we never draw that"),
        ("CVE-2026-1", {"rich==15.0.0": [BAD]}, PASSED, "accepted: rich 15.0.0: PYSEC-2026-7"),
        ("CVE-2026-1", {"rich==15.0.0": [BAD, ANOTHER]}, FAILED, "PYSEC-2026-8"),
        ("", {"mavproxy==1.8.75": "unknown"}, FAILED, "not audited: mavproxy not found\n"),
    ):
        auditor.accept(ACCEPTED.format(accepted) if accepted else "")
        done = auditor.run(answer)
        assert (done.status, words in done.text) == (status, True), done


def test_without_a_network_it_is_skipped_and_says_so(auditor: Auditor) -> None:
    for said in (
        "ERROR:pip_audit._cli:Could not connect to PyPI's vulnerability feed",
        "requests.exceptions.ReadTimeout: timed out",
    ):
        done = auditor.run(SAYS=said)
        assert done.status == SKIPPED
        assert done.text == f"no network ({said}): the lock was not asked about\n"


def test_what_is_accepted_in_this_tree_can_be_read(auditor: Auditor) -> None:
    shutil.copy(ROOT / "tools" / "lock" / "accepted.toml", auditor.lock)
    assert auditor.run().status == PASSED


def test_every_pin_has_a_hash_and_the_set_up_asks_for_it() -> None:
    for name in ("demo.txt", "requirements.txt", "without_dependencies.txt"):
        text = (ROOT / "tools" / "lock" / name).read_text("utf-8")
        pins = [block for block in text.replace("\\\n", " ").splitlines() if "==" in block]
        assert pins
        assert [pin for pin in pins if "--hash=sha256:" not in pin] == []
        assert "://" not in text, "where packages come from is the machine's business"
    source = (ROOT / "tools" / "setup_venv.py").read_text("utf-8")
    installs = [line.strip() for line in source.splitlines() if "_pip_install(" in line]
    installs = [line for line in installs if not line.startswith("def ")]
    assert len(installs) == 3
    for line in installs:
        assert '"--require-hashes"' in line or '"--no-build-isolation"' in line
