"""Test the page: every row of the targets, and numbers that can be counted by hand."""

import numpy as np
import pytest
from scipy.stats import binom

from benchmarks.exam.judging import judge
from benchmarks.exam.page import by_effect, by_factor, coverage, marked, mistakes, page, reliability, targets
from benchmarks.exam.rows import ROWS
from benchmarks.tests.exam.answers import answer, effect, gap, ranked, truth

LAG = {"name": "outflow_lag", "lag": 300.0}


def result(seed, given, *planted, floor=None, **more):
    return {
        "seed": seed, "revision": "abc", "truth": truth(*planted, **more) | {"seed": seed}, "answer": given,
        "floor": floor,
    }  # fmt: skip


RESULTS = [
    result(10000, answer(errors=gap(end=(4.0, 8.0, 20.0)))),
    result(10001, answer(effect("leakage"))),
    result(10002, answer(effect("outflow_lag", parameters=[("lag", 290.0, 250.0, 330.0, "s")])), LAG,
           floor=[2.0, 4.0, 10.0]),
    result(10003, answer(effect("clock_offset")), LAG, floor=[2.0, 4.0, 10.0]),
    result(10004, answer(), LAG, times=[1.5]),
]  # fmt: skip
JUDGED = [j for _, j in marked(RESULTS)]


def test_every_row_is_there_even_without_a_season():
    text = page([])
    assert all(asked.words in text for asked in ROWS)
    assert "No season has been answered yet." in text


def test_shares_are_counted_as_by_hand():
    text = targets(JUDGED)
    assert "| any name | <= 0.01 | 2 | 1 | 1/2" in text
    assert "| >= 2x, separable: first | >= 0.97 | 2 | 1 | 1/2" in text
    assert "| >= 2x, separable: wrong | <= 0.01 | 2 | 1 | 1/2" in text
    assert "| 1x to 2x: found | >= 0.70 | 1 | 0 | 0/1" in text
    assert "median | >= 0.95 | 2 | - | 1.00 | reached |" in text
    assert "| intervals cover | 0.92 to 0.97 | 1 | 1 |" in text


def test_mistakes_are_listed_with_their_seeds():
    text = mistakes(marked(RESULTS))
    assert "| 10001 | nothing | box | - | explained | leakage |" in text
    assert "| 10003 | separable | box | outflow_lag (4.0x) | explained | clock_offset |" in text
    assert text.count("\n") == 4
    assert mistakes([]) == "None.\n"


def test_effects_and_factors_have_their_lines():
    assert "| outflow_lag | 0/1 | - | 1/2 | 1/3 | 1/3 | 0/3 | 1.00 |" in by_effect(marked(RESULTS))
    text = by_factor(marked(RESULTS))
    assert "| sample time | 133 to 300 s | 5 | 1/2" in text
    assert "| evidence | - | 2 |" in text and "|  | 30 to 100 nats | 3 |" in text
    assert "| size | - | 2 |" in text and "|  | 1x to 2x | 1 |" in text and "|  | 4x to 8x | 2 |" in text
    assert "| outflow_lag.lag | 0.92 to 0.97 | 1 | 1/1" in coverage(JUDGED)


@pytest.mark.parametrize(("share", "near"), [(0.75, True), (0.55, False)])
def test_probabilities_are_reliable_where_so_many_names_are_right(share, near):
    n = 400
    right = np.arange(n) < round(share * n)
    judged = [
        judge(answer(ranking=ranked((["outflow_lag" if hit else "leakage"], 0.75), ([], 0.25))), truth(LAG))
        for hit in right
    ]
    line = next(line for line in reliability(judged).splitlines() if line.startswith("| 0.7 to 0.8"))
    assert f"| {n} | 0.75 | {round(share * n)}/{n}" in line
    assert line.endswith(f"| {'yes' if near else 'no'} |")


@pytest.mark.parametrize(("hits", "n"), [(0, 12), (1, 12), (3, 12), (12, 12)])
def test_a_share_is_refused_where_chance_would_hardly_give_it(hits, n):
    named = judge(answer(effect("leakage")), truth())
    quiet = judge(answer(), truth())
    judged = [named] * hits + [quiet] * (n - hits)
    most = 0.01
    expected = sum(binom.pmf(k, n, most) for k in range(hits, n + 1)) < 0.01
    assert ROWS[0].refused(judged) == expected
    assert not ROWS[0].refused([])
