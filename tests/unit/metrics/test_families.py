"""The names of the metrics follow Prometheus' conventions, and the dashboard uses no others."""

import json
import re
from typing import Any

from mav_tasks.metrics.exposition import PREFIX
from mav_tasks.metrics.families import FAMILIES
from mav_tasks.metrics.pages import dashboard

#: labels with a bounded number of values each, whatever clients send
LABELS = "vehicle state reason outcome link direction side code version python"
UNITS = ("seconds", "bytes")
NO_UNITS = ("milliseconds", "_ms", "minutes", "kilobytes", "percent")
NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
#: words of PromQL in the dashboard that are no metrics
WORDS = {
    *("sum", "max", "by", "le", "rate", "increase", "histogram_quantile", "and", "on"),
    *("instance", "vehicle", "state", "reason", "outcome", "link", "direction", "side"),
}


def test_each_name_is_used_once_and_follows_the_conventions() -> None:
    names = [family.name for family in FAMILIES]
    assert len(set(names)) == len(names)
    for family in FAMILIES:
        assert NAME.fullmatch(family.name), family.name
        assert family.name.startswith((PREFIX, "process_")), family.name
        assert family.name.endswith("_total") == (family.kind == "counter"), family.name
        assert not family.name.endswith(("_count", "_sum", "_bucket", *NO_UNITS)), family.name
        if family.kind == "histogram":
            assert family.name.endswith(UNITS), family.name
        assert family.meaning.endswith("."), family.name
        assert "\n" not in family.meaning, family.name


def test_labels_have_few_values() -> None:
    assert {label for family in FAMILIES for label in family.labels} == set(LABELS.split())


def expressions(node: Any) -> list[str]:
    if isinstance(node, list):
        return [found for each in node for found in expressions(each)]
    if not isinstance(node, dict):
        return []
    own = [node["expr"]] if "expr" in node else []
    if isinstance(node.get("query"), dict):
        own.append(node["query"]["query"])
    return own + [found for each in node.values() for found in expressions(each)]


def test_every_query_of_the_dashboard_uses_metrics_that_exist() -> None:
    series = {name: family for family in FAMILIES for name in family.series}
    found = expressions(json.loads(dashboard()))
    assert len(found) > 30
    for expression in found:
        bare = re.sub(r'"[^"]*"|\[[^]]*\]', "", expression).replace("label_values", "")
        words = set(re.findall(r"[a-z_]{2,}", bare)) - WORDS
        assert words <= set(series), expression
        for name, selector in re.findall(r"(\w+)\{([^}]*)\}", expression):
            wanted = set(re.findall(r"(\w+)=~", selector)) - {"instance"}
            assert wanted <= set(series[name].labels), expression
        for labels in re.findall(r"\b(?:sum|max) by \(([^)]*)\)", expression):
            known = {label for word in words for label in series[word].labels}
            assert set(labels.split(", ")) - {"le"} <= known, expression
        if "histogram_quantile" in expression:
            assert "_bucket{" in expression
