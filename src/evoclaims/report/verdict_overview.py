"""All verdicts in Markdown: tables by sentence, as marks and by reading; and sentences on how many ended how."""

from __future__ import annotations

import math
import string
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

from evoclaims.judging.verdict import Outcome
from evoclaims.paper.reported import Uncovered
from evoclaims.report import table_cells
from evoclaims.report.formatting import literal, plural, table
from evoclaims.report.table_cells import NONE, in_the_papers_order
from evoclaims.report.trial_summary import Reader
from evoclaims.verdicts.claim_report import APART, CONTROL, MECHANISM, ClaimReport, Tally, named
from evoclaims.verdicts.history import ordered
from evoclaims.verdicts.readings import ReadAs
from evoclaims.verdicts.sentences import Sentence, chance, sentences

Versions = dict[str, str]
_Rows = dict[tuple[str, str], dict[str, list[ClaimReport]]]
"""Reports of a claim and a sentence, by the heading of their column."""

_SHOWN: Final = ("python", "jax", "jaxlib")
"""Packages whose versions are shown for every trial; others only where a trial depends on them."""

HOW: Final = (
    "In parentheses, what decided: in how many of the judged trials an event holds, or the effect (A12: how often a "
    "trial of one side beats one of the other), or how many trials lie in a range; where a claim has several parts, "
    "the part that decided it, or that left it open. Then a letter for the device and the versions that the trials "
    "were made with."
)
"""How to read the table."""

NOT_RUN: Final = "*not run*: some of its trials are missing, or there is no test of it at this tier."
NOT_CHANGED: Final = f"{NONE}: the variant changes none of the claim's trials, or they have not run."


def overview(columns: Mapping[str, Sequence[ClaimReport]], sentences: Mapping[str, str], reader: Reader) -> str:
    """Return tables of the paper's claims, controls and mechanisms, and what letters for devices and versions mean.

    Args:
        columns: reports by heading.
        sentences: the paper's own by claim, such as "G1[n_parity]".
        reader: reads the trials behind the reports.
    """
    made = Environments(reader)
    papers: _Rows = {}
    others: dict[str, _Rows] = {CONTROL: {}, MECHANISM: {}}
    for heading, reports in columns.items():
        for report in in_the_papers_order(reports):
            rows = others.get(report.where, papers)
            line = rows.setdefault((report.claim, sentences[report.name]), defaultdict(list))
            line[heading].append(report)
    tables = [
        _table(*headings, columns, rows, made)
        for headings, rows in (
            (("claim", "the paper says"), papers),
            (("control", "what the benchmark checks"), others[CONTROL]),
            (("mechanism", "what a part of a method or a task does"), others[MECHANISM]),
        )
        if rows
    ]
    every = [report for reports in columns.values() for report in reports]
    missing = any(report.outcome is Outcome.NOT_RUN and not report.variant for report in every)
    says = [HOW, *([NOT_RUN] if missing else []), *([NOT_CHANGED] if any(report.variant for report in every) else [])]
    blocks = (*tables, " ".join(says), made.legend())
    return "\n\n".join(filter(None, blocks))


class Environments:
    """Letters for what trials were made on and with, given in the order of appearance."""

    def __init__(self, reader: Reader) -> None:
        """Start without any."""
        self._reader = reader
        self._known: list[tuple[str, Versions]] = []

    def letters(self, report: ClaimReport) -> str:
        """Return the letters of a report's trials, such as "A" or "A, C"."""
        found = {
            self._place(trial.origin.device, _shown(trial.origin.versions, source.versions))
            for source in report.sources
            for trial in self._reader.read(source.trials, source.installed)
        }
        return ", ".join(map(_letter, sorted(found)))

    def legend(self) -> str:
        """Return a line for each letter."""
        return "\n".join(
            f"* {_letter(place)}: {literal(device)}; {literal(', '.join(map(' '.join, sorted(versions.items()))))}"
            for place, (device, versions) in enumerate(self._known)
        )

    def _place(self, device: str, versions: Versions) -> int:
        """Return the place of the first environment that differs in nothing, after adding what it did not know."""
        for place, (known, together) in enumerate(self._known):
            if known == device and all(together.get(name, version) == version for name, version in versions.items()):
                together.update(versions)
                return place
        self._known.append((device, dict(versions)))
        return len(self._known) - 1


def _letter(place: int) -> str:
    """Return the letter of the environment at a place, counted from 0; after Z come A1 to Z1, then A2."""
    again, which = divmod(place, len(string.ascii_uppercase))
    return string.ascii_uppercase[which] + (str(again) if again else "")


def _shown(versions: Iterable[tuple[str, str]], needed: Iterable[str]) -> Versions:
    names = {*_SHOWN, *needed}
    known = dict(versions)
    return {name: known.get(name) or "none" for name in names}


def _table(name: str, says: str, columns: Iterable[str], rows: _Rows, made: Environments) -> str:
    lines = [
        (
            *map(literal, (claim, sentence)),
            *(_by_case((_verdict(one, made), one.case) for one in found[heading]) or NONE for heading in columns),
        )
        for (claim, sentence), found in rows.items()
    ]
    return table((name, says, *map(literal, columns)), lines)


def _by_case(verdicts: Iterable[tuple[str, str]]) -> str:
    """Return verdicts with their cases, one line for all cases that are alike."""
    alike: dict[str, list[str]] = defaultdict(list)
    for verdict, case in verdicts:
        alike[verdict].append(literal(case))
    if len(alike) == 1:
        return next(iter(alike))
    return "<br>".join(f"{', '.join(cases)}: {verdict}" for verdict, cases in alike.items())


def _verdict(report: ClaimReport, made: Environments) -> str:
    """Return a verdict with its evidence in short, such as "**refuted** (2 of 10 trials; A)"."""
    if not report.n:
        return NONE if report.variant and report.outcome is Outcome.NOT_RUN else literal(report.outcome)
    outcome = f"**{literal(report.outcome)}**{table_cells.remarks(report)}"
    return f"{outcome} ({literal(_evidence(report))}; {made.letters(report)})"


def _evidence(report: ClaimReport) -> str:
    part = report.verdict.deciding_part if report.verdict else None
    trials = plural(report.n, "trial")
    if report.verdict is None or part is None:
        return trials
    trials = plural(part.n, "trial")  # those that count: copies count once
    several = len(report.verdict.evidence) > 1
    what = f"{part.samples[0].label.partition(': ')[2]}: " if several and part.samples else ""
    if part.events:
        return f"{what}{sum(part.samples[0].values):g} of {trials}"
    if part.a12 is not None:
        return f"{what}A12 {part.a12:.2f}, {trials} a side"
    ends = [f"{bound.value:g}" for bound in part.bounds]
    within = f" [{', '.join(ends)}]" if len(ends) == 2 else ""
    return f"{what}{part.detail}{within}; {trials}" if part.detail else trials


WORDS: Final = 10
"""Words of a sentence that has no short form."""

HEADINGS: Final = ("claim", "the paper says")


def marks(
    columns: Mapping[str, Sequence[ClaimReport]], sentences: Mapping[str, str], short: Mapping[str, str] | None = None
) -> str:
    """Return the table of the paper's own claims; controls are left out.

    Args:
        columns: reports by heading.
        sentences: the paper's own by claim and case, such as "G1[n_parity]".
        short: the sentences to show, in a short form, by the first column; without any all, cut after `WORDS` words.
    """
    cases: dict[tuple[str, str], dict[str, list[ClaimReport]]] = {}
    for heading, reports in columns.items():
        for report in in_the_papers_order(reports):
            if not report.is_control:
                line = cases.setdefault((report.claim, sentences[report.name]), defaultdict(list))
                line[heading].append(report)
    several = {claim for claim, count in Counter(claim for claim, _ in cases).items() if count > 1}
    rows = []
    for (claim, sentence), found in cases.items():
        named_cases = dict.fromkeys(report.case for reports in found.values() for report in reports)
        name = literal(named(claim, ", ".join(named_cases) if claim in several else ""))
        if not short or name in short:
            words = sentence.split()
            first = sentence if len(words) <= WORDS else " ".join(words[:WORDS]) + " …"
            text = short[name] if short else literal(first)
            rows.append((name, text, *(mark(found[heading]) for heading in columns)))
    return table((*HEADINGS, *map(literal, columns)), rows)


def mark(reports: Iterable[ClaimReport]) -> str:
    """Return the mark of a sentence's cases, such as "✓"; with numbers of cases where they differ, such as "✓1 ✗3 –1".

    Support that is counted apart is in brackets. Cases that are not judged stand beside judged ones, which else would
    seem to be all of the sentence.
    """
    tallies = Counter(report.counted_as for report in reports)
    left_out = tallies.pop(Tally.NOT_RUN, 0)
    found: Counter[str] = Counter()
    for tally in Tally:
        found[f"({tally.symbol})" if tally in APART else tally.symbol] += tallies[tally]
    shown = {symbol: count for symbol, count in found.items() if count}
    if shown and left_out:
        shown[NONE] = left_out
    if len(shown) < 2:
        return next(iter(shown), NONE)
    return " ".join(f"{symbol}{count}" for symbol, count in shown.items())


def short_sentences(text: str) -> dict[str, str]:
    """Return the sentences of a table that was written before, by the first column."""
    _, _, *lines = [line for line in text.splitlines() if line.startswith("|")] or ["", ""]  # two are the heading
    rows = (line.strip("|\n ").split(" | ") for line in lines)
    return {cells[0]: cells[1] for cells in rows if len(cells) >= len(HEADINGS)}


YOUNGER: Final = "†"
HOW_JUDGED: Final = (
    "The first reading of a sentence is the one that its claim judges; the others are judged from the same trials, and "
    f"decide nothing. {YOUNGER}: the reading is younger than the first of its trials, and may have been chosen by what "
    "they show."
)
"""How to read the table."""


def readings(reports: Iterable[ClaimReport]) -> str:
    """Return one line for each reading of a sentence, in the order of the paper's lines, with the cases' verdicts."""
    papers = [report for report in ordered(reports) if report.readings and not report.is_control]
    papers.sort(key=lambda one: math.inf if one.line is None else one.line)
    rows: dict[tuple[str, str, str], list[tuple[ClaimReport, ReadAs]]] = defaultdict(list)
    for report in papers:
        for one in report.readings:
            rows[report.claim, report.statement, one.name].append((report, one))
    shown: set[tuple[str, str]] = set()
    lines = []
    for (claim, sentence, name), found in rows.items():
        new = (claim, sentence) not in shown
        shown.add((claim, sentence))
        line = "" if found[0][0].line is None else str(found[0][0].line)
        head = (literal(claim), line, literal(sentence)) if new else ("", "", "")
        lines.append((*head, literal(name), _since(found), _verdicts(found)))
    headings = ("claim", "line", "the paper says", "read as", "since", "verdict")
    return f"{table(headings, lines)}\n\n{HOW_JUDGED}" if lines else "No reading is judged."


def without_claims(sentences: Sequence[Uncovered]) -> str:
    """Return a table of the sentences that no claim judges."""
    lines = [(str(one.line), literal(one.says), literal(one.because)) for one in sentences]
    return table(("line", "the paper says", "no claim, because"), lines) if lines else "Every sentence has a claim."


def _since(found: Sequence[tuple[ClaimReport, ReadAs]]) -> str:
    """Return when a reading was written, with a mark if it is younger than some case's trials."""
    since = found[0][1].since or "–"
    return f"{literal(since)} {YOUNGER}" if any(one.late for _, one in found) else literal(since)


def _verdicts(found: Sequence[tuple[ClaimReport, ReadAs]]) -> str:
    vacuous = [", vacuous" * (report.is_vacuous and one is report.readings[0]) for report, one in found]
    return _by_case(
        (f"{literal(one.outcome)}{more}", report.case) for (report, one), more in zip(found, vacuous, strict=True)
    )


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
