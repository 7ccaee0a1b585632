"""Ask pip-audit for known vulnerabilities of the packages in tools/lock.

Exit 0: none; 1: some, or the audit failed; 75: skipped without a network: the first line says so,
and tools/check repeats it. The audit covers the whole lock, not the installed environment, also
packages for other systems and Python versions.

tools/lock/accepted.toml lists accepted vulnerabilities, each with its reason.
"""

import json
import re
import shutil
import subprocess
import sys
import tempfile
import textwrap
import tomllib
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

LOCK = Path(__file__).resolve().parent / "lock"
FILES = ("requirements.txt", "without_dependencies.txt")
ACCEPTED = "accepted.toml"

LIMIT = 60.0  # s, for everything: a hanging network must not block the gate
ANSWER = 10  # s, per request
FAILED, SKIPPED = 1, 75

PIN = re.compile(r"([A-Za-z0-9._-]+)==([^\s;\\]+)")
#: messages of pip-audit, or requests under it, without a network; 403 and 407 come from a proxy
NO_NETWORK = re.compile(
    r"ConnectionError|ConnectTimeout|ReadTimeout|ProxyError|SSLError|Could not connect"
    r"|Failed to resolve|Name or service not known|Temporary failure in name resolution"
    r"|Network is unreachable|HTTPError: (?:403|407|429|5\d\d)"
)


class AuditError(Exception):
    """The audit failed; the message has the reason."""


class NoNetwork(Exception):
    """The network is unreachable; the message says what was tried."""


class Accepted(NamedTuple):
    """An accepted vulnerability."""

    number: str
    reason: str


class Found(NamedTuple):
    """A vulnerability of a pinned package, with all its names."""

    package: str
    version: str
    numbers: tuple[str, ...]
    fixed_in: tuple[str, ...]

    def __str__(self) -> str:
        fixed = " or ".join(self.fixed_in) if self.fixed_in else "no version yet"
        return f"{self.package} {self.version}: {', '.join(self.numbers)}, fixed in {fixed}"


def rounds(texts: list[str]) -> list[list[str]]:
    """Return the pins of lock files, in lists in which each package occurs once.

    A lock has two versions of a package if Python versions need different ones.
    """
    found: list[dict[str, str]] = []
    for text in texts:
        for line in text.splitlines():
            pin = PIN.match(line)
            if pin is None:
                continue
            name = pin[1].lower()
            free = next((each for each in found if name not in each), None)
            if free is None:
                free = {}
                found.append(free)
            free[name] = f"{name}=={pin[2]}"
    if not found:
        raise AuditError(f"no pins in {' and '.join(FILES)}")
    return [list(each.values()) for each in found]


def accepted(text: str) -> list[Accepted]:
    """Read the accepted vulnerabilities. Raise AuditError if one has no reason."""
    try:
        entries = tomllib.loads(text).get("accepted", [])
        known = [Accepted(entry["id"].strip(), entry["reason"].strip()) for entry in entries]
    except (tomllib.TOMLDecodeError, KeyError, AttributeError, TypeError) as error:
        raise AuditError(f"{ACCEPTED}: expected [[accepted]] with id and reason: {error}") from None
    for each in known:
        if not each.number or len(each.reason.split()) < 3:
            raise AuditError(f"{ACCEPTED}: {each.number or 'an entry'} has no reason")
    return known


def audit(pins: list[str], *, within: float) -> list[Found]:
    """Run pip-audit on pins. Raise NoNetwork without an answer, AuditError on any other error."""
    command = shutil.which("pip-audit")
    if command is None:
        raise AuditError("pip-audit is not installed: run tools/setup")
    with tempfile.TemporaryDirectory() as folder:
        wanted, answer = Path(folder) / "pins.txt", Path(folder) / "answer.json"
        wanted.write_text("\n".join(pins) + "\n", encoding="utf-8")
        arguments = ["--no-deps", "--disable-pip", "-r", str(wanted), "--format", "json"]
        arguments += ["--aliases", "on", "--desc", "off", "--progress-spinner", "off"]
        arguments += ["--timeout", str(ANSWER), "--output", str(answer)]
        try:
            done = subprocess.run(
                [command, *arguments], capture_output=True, text=True, timeout=within, check=False
            )
        except subprocess.TimeoutExpired:
            raise NoNetwork(f"no answer within {LIMIT:g} s") from None
        said = (done.stdout + done.stderr).strip()
        if not answer.is_file():
            if NO_NETWORK.search(said):
                raise NoNetwork(textwrap.shorten(said.splitlines()[-1], 100))
            raise AuditError(f"pip-audit ended with {done.returncode}:\n{said}")
        return _found(json.loads(answer.read_text(encoding="utf-8")), asked=len(pins))


def _found(answer: Any, *, asked: int) -> list[Found]:
    packages = answer["dependencies"]
    unknown = [each for each in packages if "skip_reason" in each]
    if len(unknown) == asked:
        raise NoNetwork("whoever answers knows none of the packages")
    if unknown:
        raise AuditError("\n".join(f"not audited: {each['skip_reason']}" for each in unknown))
    if len(packages) != asked:
        raise AuditError(f"asked about {asked} packages, told about {len(packages)}")
    return [
        Found(
            each["name"],
            each["version"],
            (vulnerability["id"], *vulnerability.get("aliases", ())),
            tuple(vulnerability["fix_versions"]),
        )
        for each in packages
        for vulnerability in each["vulns"]
    ]


def main(folder: Path) -> int:
    """Audit the lock files of a folder; return the exit code."""
    end = monotonic() + LIMIT
    try:
        lived_with = accepted((folder / ACCEPTED).read_text(encoding="utf-8"))
        reasons = {each.number: each.reason for each in lived_with}
        asked = rounds([(folder / name).read_text(encoding="utf-8") for name in FILES])
        found = [
            each for pins in asked for each in audit(pins, within=max(end - monotonic(), 0.001))
        ]
    except NoNetwork as why:
        print(f"no network ({why}): the lock was not asked about")
        return SKIPPED
    except (AuditError, OSError) as error:
        print(error)
        return FAILED
    for each in found:
        known = next((number for number in each.numbers if number in reasons), None)
        print(f"accepted: {each}: {reasons[known]}" if known else f"vulnerable: {each}")
    named = {number for each in found for number in each.numbers}
    for number in sorted(set(reasons) - named):
        print(f"accepted, but not found any more: {number}: remove it from {ACCEPTED}")
    return FAILED if any(reasons.keys().isdisjoint(each.numbers) for each in found) else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]) if sys.argv[1:] else LOCK))
