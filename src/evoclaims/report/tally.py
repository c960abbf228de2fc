"""How many verdicts ended how, in sentences: by sentence of the paper, by case, and what chance may have decided."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Final

from evoclaims.report import table_cells
from evoclaims.report.formatting import plural
from evoclaims.verdicts.claim_report import CONTROL, MECHANISM, ClaimReport, Tally
from evoclaims.verdicts.sentences import Sentence, chance, sentences

_OTHERS: Final = {CONTROL: "the benchmark itself", MECHANISM: "parts of methods and tasks"}
"""What cases that are no sentence of the paper test."""


def tally(reports: Sequence[ClaimReport]) -> str:
    """Return the sentences, such as "Of 3 sentences of the paper, 2 **supported** and 1 **refuted** ...".

    Sentences that another one's result decides count once; controls and mechanisms are counted apart.
    """
    others = {kind: [report for report in reports if report.where == kind] for kind in _OTHERS}
    papers = [report for report in reports if not report.is_control]
    lines = []
    if papers or not any(others.values()):
        lines += [by_sentence(sentences(papers)), f"By case, of {len(papers)}: {_counted(papers)}."]
        lines += by_chance(papers)
    lines += [
        f"Of {plural(len(cases), 'case')} of {kind}s, which test {_OTHERS[kind]}, {_counted(cases)}."
        for kind, cases in others.items()
        if cases
    ]
    return " ".join(lines)


def by_sentence(found: Sequence[Sentence]) -> str:
    """Return how many sentences ended how; those with the result of another one count once."""
    own = [one for one in found if not one.same_as]
    again = [one for one in found if one.same_as]
    once = f" ({', '.join(f'{one.claim} as {one.same_as[0]}' for one in again)} counted once)" if again else ""
    ends = Counter(one.outcome for one in own)
    ends_listed = _listed(
        f"{count} **{_SENTENCE.get(ended, str(ended))}**" for ended in Tally if (count := ends[ended])
    )
    return f"Of {plural(len(own), 'sentence')} of the paper{once}, {ends_listed}."


_SENTENCE = {
    Tally.SUPPORTED: "supported in every case",
    Tally.REFUTED: "refuted in some case",
    Tally.SMALLER: "smaller than claimed in some case",
    Tally.INCONCLUSIVE: "undecided",
}
"""How a sentence's outcome is written, where a case's is written otherwise."""


def by_chance(papers: Sequence[ClaimReport]) -> list[str]:
    """Return what chance may have decided; nothing where nothing was tested."""
    found = chance(papers)
    if not found.tested:
        return []
    ended = Counter(report.outcome.value for report in papers)
    survive = "; one of ".join(
        f"{rate:g} leaves {kept[0]} of {ended['supported']} supported and {kept[1]} of {ended['refuted']} refuted"
        for rate, kept in found.kept.items()
    )
    return [
        f"Chance alone would support at most {found.expected:.1f} of {found.tested} tested cases if every claim were "
        f"false, and refute at most as many if every claim were true. By Benjamini and Hochberg's "
        f"procedure, a false discovery rate of {survive}."
    ]


def _counted(reports: Sequence[ClaimReport]) -> str:
    """Return how many count as what, such as "17 **supported** and 3 **not run**"."""
    return _listed(f"{count} **{ended}**" for ended, count in table_cells.counts(reports).items())


def _listed(texts: Iterable[str]) -> str:
    """Return texts with commas, and "and" before the last; "none" without any."""
    several = [*texts]
    return " and ".join(filter(None, (", ".join(several[:-1]), several[-1]))) if several else "none"
