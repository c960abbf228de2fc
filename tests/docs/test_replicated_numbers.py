"""How many published numbers replicate, by README and docs/results.md, is what the table in docs/replication.md gives.

That table is written from the reference trials, and another test compares it with them (test_generated_tables.py).
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RESULTS = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
PUBLISHED, WITH_ROWS = "published", r"published\_rows\_so\_far"


def _numbers(protocol: str) -> dict[str, str]:
    """Return whether each published number is inside, outside or unknown with our trials under a reading."""
    replication = (ROOT / "docs" / "replication.md").read_text(encoding="utf-8")
    lines = re.findall(r"^\| ([^|]+) \| ([^|]+) \| [^|]+ \| [^|]+ \| . ([^|]+) \|", replication, re.MULTILINE)
    found = {number: result for number, under, result in lines if under == protocol}
    assert {"inside", "outside"} <= set(found.values()) <= {"inside", "outside", "cannot be said"}
    return found


def _counts(protocol: str) -> tuple[int, int, int]:
    """Return how many numbers have trials under a reading, how many are inside, and of the same with the text's."""
    found, text = _numbers(protocol), _numbers("the protocol")
    return (
        len(found),
        sum(result == "inside" for result in found.values()),
        sum(text[number] == "inside" for number in found),
    )


@pytest.mark.parametrize("protocol", [PUBLISHED, WITH_ROWS])
def test_the_results_count_the_numbers_that_replicate(protocol: str) -> None:
    count, inside, with_text = _counts(protocol)
    (line,) = re.findall(rf"^\| [^|]*\(`{protocol.replace(chr(92), '')}`\)[^|]*(\|.*)$", RESULTS, re.MULTILINE)
    assert line == f"| {count} | **{inside}** | {with_text} |"


def test_the_readme_counts_the_numbers_that_replicate() -> None:
    count, inside, with_text = _counts(PUBLISHED)
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert (
        f"Of {count} published numbers {inside} replicate with the published scripts' settings, and {with_text} with "
        "the text's."
    ) in readme
