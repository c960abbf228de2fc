"""README's sentence on how many refutations depend on a detail is what the protocol's table of variants says.

That table is written from the reference trials, and another test compares it with them (test_generated_tables.py).
"""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
WORDS = ("none", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
ROWS, SIGMOID, NEAT, ALL = r"rows\_so\_far", "sigmoid", r"published\_neat", "published"


def _rows(page: str) -> list[dict[str, str]]:
    """Return the lines of the table of details of the full tier, by column."""
    (block,) = re.findall(r"<!-- evoclaims: details full -->\n(.*?)<!-- evoclaims: end -->", page, re.DOTALL)
    heading, _, *lines = [line.strip("|").split(" | ") for line in block.splitlines() if line.startswith("|")]
    names = [name.strip() for name in heading]
    return [dict(zip(names, (cell.strip() for cell in line), strict=True)) for line in lines]


def _sentence(rows: list[dict[str, str]]) -> str:
    """Return the sentence that tells which refutations become other verdicts, which are bold in the table."""
    refuted = [row for row in rows if row["the protocol"] == "refuted"]
    hanging = [row for row in refuted if any(cell.startswith("**") for cell in row.values())]
    supported = [row for row in hanging if row[ROWS] == "**supported**"]
    undecided = [row for row in hanging if row[ROWS] == "**inconclusive**"]
    both = [row for row in undecided if row[SIGMOID] == "**inconclusive**"]
    with_neat = [row for row in hanging if row[NEAT] == "**inconclusive**"]
    all_supported = [row for row in hanging if row[ALL] == "**supported**"]
    all_undecided = [row for row in hanging if row[ALL] == "**inconclusive**"]
    told = sum(cell.startswith("**") for row in hanging for cell in row.values())
    assert (
        len(supported) + len(undecided) + len(both) + len(with_neat) + len(all_supported) + len(all_undecided) == told
    ), "a detail changes a refutation that README does not tell"
    return (
        f"{WORDS[len(hanging)].capitalize()} of the refutations depend on details of the published code that the "
        f"paper's text does not mention: with the rows of all levels so far, {WORDS[len(supported)]} claim about "
        f"N-parity is supported and {WORDS[len(undecided)]} are inconclusive, and {WORDS[len(both)]} of these "
        f"{WORDS[len(undecided)]} are so, too, where HyperNEAT's networks have sigmoids alone; with "
        f"the published settings of NEAT {WORDS[len(with_neat)]} of the {WORDS[len(hanging)]} is inconclusive; and "
        f"with all settings of the published code, of the claims whose trials have run, {WORDS[len(all_supported)]} is "
        f"supported and {WORDS[len(all_undecided)]} are inconclusive"
    )


def test_the_readme_tells_how_many_refutations_depend_on_a_detail_of_the_published_code() -> None:
    rows = _rows((ROOT / "docs" / "protocol.md").read_text(encoding="utf-8"))
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert _sentence(rows) in readme, "README counts otherwise than the table in docs/protocol.md"


def test_the_readme_tells_that_the_published_settings_give_the_published_numbers() -> None:
    replication = (ROOT / "docs" / "replication.md").read_text(encoding="utf-8")
    (inside,) = re.findall(r"^\* published: (\d+) inside$", replication, re.MULTILINE)
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert (
        f"With all settings of the published code, all {inside} published numbers whose trials have run replicate"
        in readme
    )
