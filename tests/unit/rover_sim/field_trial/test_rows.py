"""The table, and the quantiles in it."""

from rover_sim.field_trial.rows import Verdict, judged, not_tried, quantile, table


def test_the_table_says_asked_result_figure_limit_and_verdict() -> None:
    rows = [
        judged(
            "stop", "STOP at 1 m/s", result="stopped", figure="0.5 m", limit="1.1 x", holds=True
        ),
        judged("kill", "SIGKILL", result="HELD", holds=False),
        not_tried("boot", "3 tasks", "no way to restart it"),
    ]
    assert [row.verdict for row in rows] == [Verdict.PASS, Verdict.FAIL, Verdict.NOT_TRIED]
    lines = table(rows)
    assert lines[1].split("  ")[0].strip() == "stop"
    assert lines[1].endswith("1.1 x  PASS")
    assert lines[2].endswith("FAIL")
    assert "no way to restart it" in lines[3]


def test_quantiles_are_values_that_were_measured() -> None:
    values = [float(number) for number in range(20, 0, -1)]
    assert (quantile(values, 0.5), quantile(values, 0.95), quantile([3.0], 0.95)) == (10, 19, 3)
    assert quantile([], 0.95) == 0.0
