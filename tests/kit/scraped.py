"""A page of the metrics, Prometheus' own judgement of its text, and figures in it."""

import http.client
import shutil
import subprocess
from collections.abc import Mapping

import pytest

#: by the name of a sample, then by its labels
Figures = Mapping[str, Mapping[frozenset[tuple[str, str]], float]]


LIMIT = 30.0  # s


def asked(port: int, path: str, **headers: str) -> tuple[int, str]:
    """Return the status and the text of an answer."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=LIMIT)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, text


def figures_of(text: str) -> Figures:
    """Return the samples of a text, as the package prometheus-client reads them."""
    parser = pytest.importorskip("prometheus_client.parser")
    found: dict[str, dict[frozenset[tuple[str, str]], float]] = {}
    for family in parser.text_string_to_metric_families(text):
        assert family.documentation, family.name
        assert family.type != "unknown", family.name
        for sample in family.samples:
            series = found.setdefault(sample.name, {})
            labels = frozenset(sample.labels.items())
            assert labels not in series, sample
            series[labels] = sample.value
    return found


def figure(found: Figures, name: str, /, **labels: str) -> float:
    """Return one sample; 0 if there is none, as a counter without events has none."""
    return found.get(name, {}).get(frozenset(labels.items()), 0.0)


def check_with_promtool(text: str) -> None:
    """Let ``promtool check metrics`` judge a text, if the machine has it."""
    promtool = shutil.which("promtool")
    if promtool is not None:
        done = subprocess.run(
            [promtool, "check", "metrics"], input=text, capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stderr) == (0, "")
