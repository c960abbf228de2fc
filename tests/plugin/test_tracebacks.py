"""What pytest shows of an exception in a claim's trials: the project's own lines, unless it may be of evoclaims."""

from __future__ import annotations

from typing import Any

import pytest

ENGINE = "*trials?runner.py:*"


def test_of_an_error_in_a_method_the_projects_lines_are_shown_and_not_the_engines(project: Any) -> None:
    project.write(a="error")
    result = project.run()
    result.stdout.fnmatch_lines(
        ['>*raise RuntimeError("out of order")', "E*RuntimeError: out of order", "tiny_paper.py:*: RuntimeError"]
    )
    result.stdout.fnmatch_lines([">*trials('broken', on='parity')*"])
    result.stdout.no_fnmatch_line(ENGINE)


def test_all_of_it_is_shown_where_it_is_asked_for(project: Any) -> None:
    project.write(a="error")
    project.run("--full-trace").stdout.fnmatch_lines([ENGINE, "*RuntimeError: out of order"])


def test_all_of_an_error_that_may_be_of_evoclaims_is_shown(project: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: object, **named: object) -> None:
        raise RuntimeError("the engine stumbles")

    monkeypatch.setattr("evoclaims.trials.runner._finish_all", fail)
    project.write(a="undecided")
    project.run(own_store=True).stdout.fnmatch_lines([ENGINE, "*RuntimeError: the engine stumbles"])


def test_what_caused_an_error_is_shown_too(project: Any) -> None:
    paper = project.path / "tiny_paper.py"
    cause = (
        'try:\n            len(3)\n        except TypeError as error:\n            raise RuntimeError("out") from error'
    )
    paper.write_text(paper.read_text().replace('raise RuntimeError("out of order")', cause))
    project.write(a="error")
    result = project.run()
    result.stdout.fnmatch_lines([">*len(3)", "E*TypeError*", "tiny_paper.py:*: TypeError", "*direct cause*"])
    result.stdout.fnmatch_lines(["E*RuntimeError: out", "tiny_paper.py:*: RuntimeError"])
    result.stdout.no_fnmatch_line(ENGINE)
