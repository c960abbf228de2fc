"""How many published numbers are contradicted, by README and docs/results.md, is what docs/replication.md gives.

That table is written from the reference trials, and another test compares it with them (test_generated_tables.py).
"""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RESULTS = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
REPLICATION = (ROOT / "docs" / "replication.md").read_text(encoding="utf-8")
ANSWERS = ("consistent", "contradicted", "uninformative")
PUBLISHED, WITH_ROWS = "published", r"published\_rows\_so\_far"


def _answers(protocol: str) -> dict[str, str]:
    """Return the answer about each published number whose trials have run under a reading of the protocol."""
    lines = re.findall(r"^\| ([^|]+) \| ([^|]+) \| [^|]+ \| [^|]+ \| . (\w+)[^|]* \|", REPLICATION, re.MULTILINE)
    found = {number: answer for number, under, answer in lines if under == protocol}
    assert {"consistent", "contradicted"} <= set(found.values()) <= set(ANSWERS)
    return found


def _contradicted_by_text(protocol: str) -> int:
    text = _answers("the protocol")
    return sum(text[number] == "contradicted" for number in _answers(protocol))


@pytest.mark.parametrize("protocol", [PUBLISHED, WITH_ROWS])
def test_results_count_the_three_answers(protocol: str) -> None:
    found = _answers(protocol)
    count = Counter(found.values())
    (line,) = re.findall(rf"^\| [^|]*\(`{protocol.replace(chr(92), '')}`\)[^|]*(\|.*)$", RESULTS, re.MULTILINE)
    assert line == (
        f"| {len(found)} | {count['consistent']} | **{count['contradicted']}** | {count['uninformative']} | "
        f"{_contradicted_by_text(protocol)} |"
    )


def test_the_readme_counts_contradicted_numbers() -> None:
    found = _answers(PUBLISHED)
    contradicted = list(found.values()).count("contradicted")
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert (
        f"Of {len(found)} published numbers the scripts' trials contradict {contradicted}, the text's "
        f"{_contradicted_by_text(PUBLISHED)}."
    ) in readme
