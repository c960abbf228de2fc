"""README's sentence on how many refutations depend on a detail is what the protocol's table of variants says.

That table is written from the reference trials, and another test compares it with them (test_generated_tables.py). What
older commits have otherwise, and starts without noise, are told by docs/findings.md instead: their columns come last.
"""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
WORDS = ("none", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")
ROWS, SIGMOID, NEAT, NETWORK = r"rows\_so\_far", "sigmoid", r"published\_neat", "perceptron"
LEVEL = r"first\_level"
ALL, BOTH = "published", r"published\_rows\_so\_far"


def _rows(page: str) -> list[dict[str, str]]:
    """Return the lines of the table of details of the full tier, by column."""
    (block,) = re.findall(r"<!-- evoclaims: details full -->\n(.*?)<!-- evoclaims: end -->", page, re.DOTALL)
    heading, _, *lines = [line.strip("|").split(" | ") for line in block.splitlines() if line.startswith("|")]
    names = [name.strip() for name in heading]
    told = names[: names.index(BOTH) + 1]
    assert len(told) == 18
    return [dict(zip(told, (cell.strip() for cell in line), strict=False)) for line in lines]


def _are(number: int) -> str:
    return f"{WORDS[number]} {'is' if number == 1 else 'are'}"


def _sentence(rows: list[dict[str, str]]) -> str:
    """Return the sentence that tells which refutations become other verdicts, which are bold in the table."""
    refuted = [row for row in rows if row["the protocol"] == "refuted"]
    hanging = [row for row in refuted if any(cell.startswith("**") for cell in row.values())]

    def become(verdict: str, *details: str) -> int:
        return sum(all(row[detail] == f"**{verdict}**" for detail in details) for row in hanging)

    supported, undecided = become("supported", ROWS), become("inconclusive", ROWS)
    both, with_neat = become("inconclusive", ROWS, SIGMOID), become("inconclusive", NEAT)
    network, network_undecided = become("supported", NETWORK), become("inconclusive", NETWORK)
    all_supported, all_undecided = become("supported", ALL), become("inconclusive", ALL)
    and_rows, and_rows_undecided = become("supported", BOTH), become("inconclusive", BOTH)
    level = become("inconclusive", LEVEL)
    told = supported + undecided + both + with_neat + network + network_undecided + level
    told += all_supported + all_undecided + and_rows + and_rows_undecided
    bold = sum(cell.startswith("**") for row in hanging for cell in row.values())
    assert told == bold, "a detail changes a refutation that README does not tell"
    return (
        f"{WORDS[len(hanging)].capitalize()} of the refutations depend on details of the published code that the "
        f"paper's text does not mention or has otherwise: with the rows of all levels so far, {WORDS[supported]} claim "
        f"about N-parity is supported and {_are(undecided)} inconclusive, and {WORDS[both]} of these "
        f"{WORDS[undecided]} are so, too, where HyperNEAT's networks have sigmoids alone; with the published settings "
        f"of NEAT {_are(with_neat)} inconclusive; with the published network of CMA-ES {_are(network)} supported and "
        f"{_are(network_undecided)} inconclusive; where PPO trains on the first level alone {_are(level)} "
        f"inconclusive; with what the published scripts do otherwise, of the claims whose trials have run, "
        f"{_are(all_supported)} supported and {_are(all_undecided)} inconclusive; and if N-parity also asks the rows "
        f"of all levels so far, of those on the gates {_are(and_rows)} supported and {_are(and_rows_undecided)} "
        "inconclusive"
    )


def test_the_readme_tells_how_many_refutations_depend_on_a_detail_of_the_published_code() -> None:
    rows = _rows((ROOT / "docs" / "protocol.md").read_text(encoding="utf-8"))
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert _sentence(rows) in readme, "README counts otherwise than the table in docs/protocol.md"


def _replicated(protocol: str) -> tuple[str, dict[str, str]]:
    """Return how many published numbers our trials under a reading give, and what is said of each."""
    replication = (ROOT / "docs" / "replication.md").read_text(encoding="utf-8")
    lines = re.findall(r"^\| ([^|]+) \| ([^|]+) \| [^|]+ \| [^|]+ \| . ([^|]+) \|", replication, re.MULTILINE)
    ours = {number: said for number, under, said in lines if under == protocol}
    inside, outside, unknown = (
        sum(said == what for said in ours.values()) for what in ("inside", "outside", "cannot be said")
    )
    assert inside + outside + unknown == len(ours) > 0
    return f"{inside} of the {len(ours)}", ours


def test_the_readme_tells_how_many_published_numbers_the_published_settings_give() -> None:
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    (said, ours), (with_rows, gates), (_, text) = map(_replicated, (ALL, BOTH, "the protocol"))
    with_the_text = sum(text[number] == "inside" for number in ours)
    text_on_gates = sum(text[number] == "inside" for number in gates)
    assert (
        f"With what the published scripts do otherwise, {said} published numbers whose trials have run "
        f"replicate**; with the protocol of the text {with_the_text} of these do" in readme
    )
    assert (
        f"If N-parity also asks the rows of all levels so far, which no published script does with the curriculum, "
        f"{with_rows} on the gates replicate (with the text's protocol {text_on_gates})" in readme
    )
