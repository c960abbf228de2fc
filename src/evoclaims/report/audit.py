"""What verdicts rest on: which are vacuous, depend on the reading, are younger than their trials, or count twice."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from evoclaims.paper.reported import Uncovered
from evoclaims.paper.reproduction import NullAgent
from evoclaims.report import replication_cells, table_cells
from evoclaims.report.formatting import listed, plural
from evoclaims.report.verdict_overview import tally
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.readings import by_reading
from evoclaims.verdicts.sentences import sentences


def nulls(report: ClaimReport, agents: Mapping[str, NullAgent]) -> str:
    """Return which null agents satisfy a claim's assertion; empty where none was put to it."""
    if not agents or not report.n or report.is_control:
        return ""
    found = [f"{name} ({agents[name].says})" for name in report.satisfied_by if name in agents]
    asked = [name for name in agents if name not in dict(report.unasked)]
    says = [f"Null agents that satisfy this assertion: {', '.join(found)}."] if found else []
    if asked and not found:
        says.append(f"No null agent satisfies this assertion ({', '.join(asked)}).")
    if report.unasked:
        says.append(f"Not put to it: {', '.join(f'{name} ({reason})' for name, reason in report.unasked)}.")
    return " ".join(says)


def lines(
    reports: Sequence[ClaimReport], papers: Sequence[ClaimReport], rest: Sequence[Uncovered], nulls_: int
) -> Iterator[str]:
    """Yield an audit of a tier's verdicts, one finding a line below a heading for its kind.

    Args:
        reports: judged from the trials at hand.
        papers: judged from the paper's own numbers.
        rest: sentences without a claim.
        nulls_: how many null agents there are.
    """
    ours = [report for report in reports if not report.is_control]
    yield tally(ours).replace("**", "")
    for heading, found in _kinds(ours, papers, nulls_):
        yield ""
        yield f"{heading}: {len(found) or 'none'}"
        yield from (f"  {one}" for one in found)
    yield ""
    yield f"sentences without a claim: {len(rest) or 'none'}"
    yield from (f"  line {one.line}: {one.says} ({one.because})" for one in rest)


def fails(reports: Sequence[ClaimReport]) -> bool:
    """Whether a supported verdict is vacuous, or a claim of the paper lacks its line or the date of its reading."""
    return any(report.is_vacuous for report in reports) or bool(undated(reports))


def undated(reports: Sequence[ClaimReport]) -> list[str]:
    """Return the names of claims whose sentence is judged here, and that name no line or date of it."""
    read = [report for report in reports if report.readings and not report.is_control]
    return [report.name for report in read if report.line is None or not report.readings[0].since]


def _kinds(ours: Sequence[ClaimReport], papers: Sequence[ClaimReport], agents: int) -> Iterator[tuple[str, list[str]]]:
    satisfied = [(report, f"{report.name}: {', '.join(report.satisfied_by)}") for report in ours if report.satisfied_by]
    yield (
        f"supported and vacuous (satisfied by one of {plural(agents, 'null agent')})",
        [names for report, names in satisfied if report.is_vacuous],
    )
    yield (
        "satisfied by a null agent, but not vacuous (not supported, or a planted fault changes the verdict)",
        [f"{names} ({report.outcome})" for report, names in satisfied if not report.is_vacuous],
    )
    unasked: dict[str, list[str]] = {}
    for report in ours:
        for agent, reason in report.unasked:
            unasked.setdefault(f"{agent} ({reason})", []).append(report.name)
    yield (
        "null agents that could not be put to an assertion",
        [f"{agent}: {listed(names)}" for agent, names in sorted(unasked.items())],
    )
    yield (
        "verdicts that depend on the reading",
        [
            f"{report.name} ({report.outcome}): {by_reading(report.readings).removeprefix('depends on the reading: ')}"
            for report in ours
            if report.depends_on_the_reading
        ],
    )
    yield (
        "judged by a reading that was written after its trials ran",
        [
            f"{report.name} ({report.outcome}): written {report.readings[0].since}, first trial "
            + report.readings[0].trials_since[:16].replace("T", " ")  # to the minute
            for report in ours
            if report.readings and report.readings[0].late
        ],
    )
    yield (
        "sentences with the same result as another one",
        [f"{one.claim}: as {', '.join(dict.fromkeys(one.same_as))}" for one in sentences(ours) if one.same_as],
    )
    yield (
        "assertions that the paper's own numbers do not support",
        [
            f"{report.name}: {report.outcome}"
            for report in papers
            if replication_cells.is_decided(report) and report.outcome != "supported"
        ],
    )
    yield (
        "power of inconclusive verdicts",
        [f"{report.name}: {power}" for report in ours if (power := table_cells.power(report))],
    )
    yield "claims without the paper's line or a date", undated(ours)
