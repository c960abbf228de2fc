"""The progress line: rewritten in place on a terminal, once a minute in a log."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.claims.workload import Overview, Work, Workload
from evoclaims.paper.cost import Cost
from evoclaims.report.live_line import (
    LOG_SECONDS,
    REWRITE_SECONDS,
    LiveLine,
    beforehand,
    describe,
    describe_all,
    duration,
)
from evoclaims.trials.layout import Layout
from evoclaims.trials.lease import Running
from evoclaims.trials.progress import RunProgress

WAITING = RunProgress("ppo on n_parity", "compiling", trials=3)
TRAINING = RunProgress("ppo on n_parity", "training", 3, 1, 2000, 4000, 0.75, 1, 5, 200.0)


class Screen:
    """Where the line goes, and the time on its wall."""

    def __init__(self, columns: int | None = 120) -> None:
        self.text = ""
        self.now = 0.0
        self.line = LiveLine(self.write, columns, lambda: self.now)

    def write(self, text: str) -> None:
        self.text += text

    def shown(self, *reports: RunProgress) -> str:
        for report in reports:
            self.line(report)
        return self.text


def test_the_line_says_condition_trials_step_level_best_and_time_left() -> None:
    assert describe(TRAINING) == (
        "ppo on n_parity: 1/3 trials ended, step 2,000/4,000, level 1 of 4, best 0.750, 3 min 20 s left"
    )
    assert describe(replace(TRAINING, seconds_left=None)).endswith("best 0.750")
    assert describe(WAITING) == "ppo on n_parity: compiling (3 trials)"


def test_a_terminal_shows_one_line_of_its_own_that_is_rewritten_and_wiped_at_the_end() -> None:
    screen = Screen()
    screen.shown(WAITING)
    screen.now = REWRITE_SECONDS
    screen.shown(TRAINING)
    assert screen.text[0] == "\n"
    assert "\n" not in screen.text[1:]
    frames = screen.text[1:].split("\r")
    assert [frame.strip() for frame in frames] == [describe(WAITING), describe(TRAINING)]
    assert {len(frame) for frame in frames} == {119}
    screen.line.close()
    assert screen.text.endswith("\r" + " " * 119 + "\r")


@given(st.integers(1, 200), st.text(max_size=200))
def test_the_line_never_wraps(width: int, name: str) -> None:
    screen = Screen(width)
    screen.shown(replace(WAITING, condition=name.replace("\r", "")))
    assert len(screen.text) - 1 == max(width - 1, 20)


def test_closing_a_line_twice_or_before_it_opened_writes_nothing() -> None:
    for columns in (120, None):
        screen = Screen(columns)
        line = screen.line
        line.close()
        assert screen.text == ""
        line(TRAINING)
        line.close()
        before = screen.text
        line.close()
        assert screen.text == before


def test_a_terminal_is_not_written_to_more_often_than_anyone_reads_nor_for_nothing() -> None:
    screen = Screen()
    screen.shown(TRAINING)
    before = screen.text
    screen.shown(WAITING)
    assert screen.text == before
    screen.now = REWRITE_SECONDS
    screen.shown(TRAINING)
    assert screen.text == before
    screen.now *= 2
    screen.shown(WAITING)
    assert screen.text != before


def test_a_line_that_made_room_for_other_output_comes_back_at_once() -> None:
    screen = Screen()
    screen.shown(TRAINING)
    screen.line.close()
    assert screen.shown(TRAINING).count(describe(TRAINING)) == 2


def test_a_log_gets_a_line_a_minute_and_remarks_at_once() -> None:
    screen = Screen(None)
    remark = replace(WAITING, phase="out of time after 3 s", remark=True)
    for now, report, lines in (
        (0.0, WAITING, 1),
        (0.0, TRAINING, 1),
        (LOG_SECONDS - 0.1, TRAINING, 1),
        (LOG_SECONDS, TRAINING, 2),
        (LOG_SECONDS + 1, remark, 3),
        (LOG_SECONDS + 2, replace(TRAINING, condition="another"), 3),
        (3 * LOG_SECONDS, TRAINING, 4),
    ):
        screen.now = now
        screen.line(report)
        assert screen.text.count("\n  ") == lines
        screen.line.close()  # a verdict was written meanwhile
    assert screen.text.startswith(f"\n  {describe(WAITING)}\n")
    assert "\r" not in screen.text
    assert screen.text.endswith("\n")


def test_the_line_of_claims_says_what_runs_how_much_is_done_and_when_it_will_end() -> None:
    one = Overview(3, 63, 120, 1040, [Running("a" * 64, 0.0, TRAINING)], 700.0)
    assert describe_all(one) == f"3/63 claims, 120/1,040 trials, about 11 min 40 s left; {describe(TRAINING)}"
    two = replace(one, running=[*one.running, Running("b" * 64, 1.0, replace(WAITING, condition="neat"))])
    assert describe_all(replace(two, seconds_left=None)) == (
        "3/63 claims, 120/1,040 trials; ppo on n_parity: 1/3, step 2,000/4,000; neat: compiling"
    )


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (0, "0 s"),
        (0.4, "0 s"),
        (59.4, "59 s"),
        (59.6, "1 min 00 s"),
        (200, "3 min 20 s"),
        (3599, "59 min 59 s"),
        (3600, "1 h 00 min"),
        (7505, "2 h 05 min"),
        (360000, "100 h 00 min"),
    ],
)
def test_a_length_of_time_is_written_as_people_write_it(seconds: float, words: str) -> None:
    assert duration(seconds) == words


def test_a_run_of_hours_is_announced_with_what_is_unknown_of_it_and_a_short_one_is_not() -> None:
    def announced(layout: Layout = Layout.ALONE, **seconds: float | None) -> str:
        costs = {
            name: Cost(0.0, 9e9, 10, layout, "budget") if took is None else Cost(1.0, took, 10, layout, "elsewhere")
            for name, took in seconds.items()
        }
        works = {name: Work((name, "task"), ("smoke",), name, 0, {0: "file"}, cost) for name, cost in costs.items()}
        return beforehand(Workload("store", {}, works))

    assert announced() == announced(a=3_599.0) == announced(a=None) == announced(Layout.VECTOR, a=9_000.0) == ""
    assert announced(a=5_400.0, b=5_400.0).startswith(
        "The missing trials take up to 3 hours of a processor's core. `evoclaims"
    )
    assert announced(a=7_200.0, b=None).startswith(
        "The missing trials take up to 2 hours of a processor's core, and more without a timing. `evoclaims"
    )
