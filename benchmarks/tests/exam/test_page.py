"""The page: every row of the design, and numbers that can be counted by hand."""

from benchmarks.exam.cases import ALLOWED, Case
from benchmarks.exam.page import by_effect, marked, mistakes, page, targets
from benchmarks.exam.rows import ROWS
from benchmarks.tests.exam.answers import answer, effect, gap, truth

EMPTY = Case("nothing/uneven", "nothing_hydraulic", "uneven", 3)
LAG = Case("one/outflow_lag/x2", "one_x2", "effects/outflow_lag", 2, ("outflow_lag",), 2.0)


def result(case, seed, said, *planted, floor=None):
    return case, {
        "case": case.name, "seed": seed, "revision": "abc", "truth": truth(*planted), "answer": said,
        "floor": floor,
    }  # fmt: skip


PLANTED = {"name": "outflow_lag", "lag": 300.0}
RESULTS = [
    result(EMPTY, 5000, answer(errors=gap(end=(4.0, 8.0, 20.0)))),
    result(EMPTY, 5001, answer(effect(min(ALLOWED)))),
    result(EMPTY, 5002, answer(effect("leakage"))),
    result(LAG, 5000, answer(effect("outflow_lag", parameters=[("lag", 290.0, 250.0, 330.0, "s")])), PLANTED,
           floor=[2.0, 4.0, 10.0]),
    result(LAG, 5001, answer(effect("clock_offset")), PLANTED, floor=[2.0, 4.0, 10.0]),
]  # fmt: skip


def test_every_row_of_the_design_is_there_even_without_a_season():
    text = page([])
    assert all(row.title in text for row in ROWS)
    assert "No season was asked yet." in text


def test_shares_are_counted_as_by_hand():
    text = targets(marked(RESULTS))
    lines = {line.split(" | ")[0].strip("| "): line for line in text.splitlines()}
    assert "| a false name | <= 0.02 | 3 | 1 | 1/3" in lines["nothing missing, hydraulic truth"]
    assert "| named first | >= 0.97 | 2 | 1 | 1/2" in lines["one effect, 2x and 4x"]
    assert "| wrong alone | <= 0.01 | 2 | 1 | 1/2" in text


def test_wrong_and_false_names_are_listed_with_their_seeds():
    text = mistakes(marked(RESULTS))
    assert "| nothing/uneven | 5002 | explained | leakage |" in text
    assert "| one/outflow_lag/x2 | 5001 | explained | clock_offset |" in text
    assert text.count("\n") == 4
    assert mistakes([]) == "None.\n"


def test_effects_are_told_by_size():
    assert "| outflow_lag | - | 1/2 | - | - | 1/2 | 1/2 | 1.00 |" in by_effect(marked(RESULTS))


def test_the_whole_page_tells_gap_and_intervals_of_named_cases():
    text = page(RESULTS)
    assert "median 1.00 (target 0.90)" in text
    assert "| outflow_lag.lag | 0.92 to 0.97 | 1 | 1 |" in text
    assert "Revisions that answered: abc (5)." in text
