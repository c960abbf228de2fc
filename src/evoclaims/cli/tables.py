"""`evoclaims tables`: tables in Markdown files, written anew from the committed reference trials and the code alone.

A table is between two comments, the first of which says what it shows:

    <!-- evoclaims: verdicts full full:published smoke -->    verdicts by tier, or by tier and variant of the protocol
    <!-- evoclaims: marks text=full smoke -->                verdicts as marks, of the sentences that are there
    <!-- evoclaims: sentences full -->                        how many sentences of a tier ended how
    <!-- evoclaims: tally full -->                            the same, by case too, and what chance may have decided
    <!-- evoclaims: numbers full all -->                      published numbers and ours, under all variants
    <!-- evoclaims: details full -->                          verdicts that variants of the protocol may change
    <!-- evoclaims: refutations full -->                     which refuted claims end otherwise under a variant
    <!-- evoclaims: readings full -->                         the readings of each sentence, and their verdicts
    <!-- evoclaims: uncovered -->                             the paper's sentences that no claim judges, and why not
    <!-- evoclaims: measures -->                              what claims can read from trials
    <!-- evoclaims: assertions -->                            what they can say of it, and how it is judged
    <!-- evoclaims: commands -->                             the commands of evoclaims and their options
    <!-- evoclaims: end -->
"""

from __future__ import annotations

import argparse
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Final

from evoclaims.cli.arguments import parser
from evoclaims.cli.project import Project, open_project
from evoclaims.cli.terminal import write
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.core.files import read_text
from evoclaims.figures.replication import replications
from evoclaims.paper.reported import uncovered
from evoclaims.report import replication_cells, verdict_overview, vocabulary
from evoclaims.report.formatting import literal, plural, table
from evoclaims.report.table_cells import NONE
from evoclaims.report.trial_summary import Reader
from evoclaims.report.verdict_overview import by_sentence, marks, overview, short_sentences, tally
from evoclaims.verdicts.claim_report import ClaimReport, Tally
from evoclaims.verdicts.sentences import sentences
from evoclaims.verdicts.transitions import Robustness, matrix


def reference() -> str:
    """Return a list of all commands, and a section for each with its usage and its options."""
    commands = _commands(parser())
    index = table(("command", "purpose"), ((f"[`{name}`](#{name})", literal(says)) for name, says, _ in commands))
    return "\n\n".join([index, *(_section(name, command) for name, _, command in commands)])


def _commands(whole: argparse.ArgumentParser) -> list[tuple[str, str, argparse.ArgumentParser]]:
    """Return name, help and parser of each command, in the order of `evoclaims --help`."""
    (chosen,) = (action for action in whole._actions if isinstance(action, argparse._SubParsersAction))
    return [(str(one.dest), str(one.help), chosen.choices[one.dest]) for one in chosen._choices_actions]


def _section(name: str, command: argparse.ArgumentParser) -> str:
    says = str(command.description)
    says = literal(f"{says[:1].upper()}{says[1:]}.")
    return f"## {name}\n\n{says}\n\n{table(('argument', 'meaning'), _rows(command))}"


def _rows(command: argparse.ArgumentParser) -> Iterator[tuple[str, str]]:
    for action in command._actions:
        if not isinstance(action, argparse._HelpAction):
            yield f"`{_written(action)}`", literal(str(action.help))


def _written(action: argparse.Action) -> str:
    """Return an argument as it is written, such as "--tier TIER"."""
    value = action.metavar or action.dest.upper()
    values = " ".join(value) if isinstance(value, tuple) else value
    if not action.option_strings:
        return f"[{values}]" if action.nargs in ("?", "*") and "[" not in values else values
    if action.nargs == 0:
        return action.option_strings[0]
    if action.nargs == "+" and not isinstance(value, tuple):
        values = f"{values} …"
    return f"{action.option_strings[0]} {values}"


_TABLE: Final = re.compile(
    r"(?P<begin>^<!-- evoclaims: (?P<kind>\w+) (?P<words>[^>]*?) ?-->\n)"
    r"(?P<before>(?:(?!<!-- evoclaims: ).*\n)*?)"
    r"(?P<end>^<!-- evoclaims: end -->$)",
    re.MULTILINE,
)
_BEGIN: Final = re.compile(r"^<!-- evoclaims: (?!end -->).*-->$", re.MULTILINE)


class _JudgedOnce(Project):
    """A project whose verdicts are made once for all tables: nothing runs in between."""

    @cached_property
    def _known(self) -> dict[tuple[str, str], list[ClaimReport]]:
        return {}

    def judge_variants(self, asked: Sequence[tuple[str, str]]) -> list[list[ClaimReport]]:
        """Judge what no table before has asked for; as `Project.judge_variants` does."""
        missing = [one for one in dict.fromkeys(asked) if one not in self._known]
        self._known.update(zip(missing, super().judge_variants(missing) if missing else (), strict=True))
        return [self._known[one] for one in asked]


def main(options: argparse.Namespace) -> int:
    """Write the tables of each file anew; 1 when that changed one."""
    changed = 0
    with tempfile.TemporaryDirectory() as folder:
        opened = open_project(str(Path(folder) / "no-store"))
        project = _JudgedOnce(opened.config, opened.reproduction, opened.storage)
        for name in options.files:
            path = Path(name)
            try:
                before = read_text(path)
            except (OSError, UnicodeError) as error:
                raise UserError(f"Cannot read {path}: {getattr(error, 'strerror', None) or error}.") from error
            after = filled(before, project)
            print(f"{path}: {'changed' if after != before else 'as it was'}")
            if after != before:
                write(path, after.encode())
                changed = 1
    return changed


def filled(text: str, project: Project) -> str:
    """Return a Markdown text with its tables written anew.

    Raises:
        UserError: when it has none, one without its end, or one of an unknown kind or of more than its kind can show.
    """
    whole = {found.start() for found in _TABLE.finditer(text)}
    alone = [begin[0] for begin in _BEGIN.finditer(text) if begin.start() not in whole]
    if whole and alone:
        raise UserError(f"{alone[0]} has no <!-- evoclaims: end --> before the next table. Write one.")
    if not whole:
        raise UserError(
            "There is no table to write: put <!-- evoclaims: verdicts full --> and <!-- evoclaims: end -->."
        )
    return _TABLE.sub(lambda found: f"{found['begin']}\n{_made(found, project)}\n\n{found['end']}", text)


def _made(found: re.Match[str], project: Project) -> str:
    kind, words = found["kind"], found["words"].split()
    if kind not in _KINDS:
        raise UnknownNameError("kind of table", kind, _KINDS)
    return _KINDS[kind](project, words, found["before"])


def _columns(project: Project, words: list[str]) -> tuple[dict[str, list[ClaimReport]], dict[str, str]]:
    """Return reports by heading, and the paper's own sentences.

    Each word is a tier, or a tier and a variant, with another heading or without: full, full:published, text=full.
    """
    tiers = list(project.reproduction.tiers)[::-1]  # the paper's own sentences come first
    asked: dict[str, tuple[str, str]] = {}
    for word in words or tiers:
        heading, _, column = word.rpartition("=")
        tier, _, variant = column.partition(":")
        project.reproduction.tier(tier, variant)
        asked[heading or ", ".join(filter(None, (tier, variant)))] = tier, variant
    every = list(dict.fromkeys((*asked.values(), (tiers[0], ""))))
    judged = dict(zip(every, project.judge_variants(every), strict=True))
    says = {report.name: report.statement for report in judged[tiers[0], ""]}
    return {heading: judged[column] for heading, column in asked.items()}, says


def _of_a_tier(shown: Callable[[list[ClaimReport]], str]) -> Callable[[Project, list[str], str], str]:
    """Return what makes a table of one tier's verdicts."""
    return lambda project, words, _: shown(project.judge(_tier(project, words)))


def _details(project: Project, words: list[str], *_: str) -> str:
    """Return the verdicts of a tier under the protocol and under each variant, of the claims that a variant touches."""
    rows, variants = _under_variants(project, _tier(project, words))
    tried = [name for name in variants if any(name in row.outcomes for row in rows)]
    left = ", ".join(name for name in variants if name not in tried)
    unjudged = f"No claim's trials have all run under: {literal(left)}." if left else ""
    return "\n\n".join(filter(None, (_robustness(rows, tried), unjudged)))


def _refutations(project: Project, words: list[str], *_: str) -> str:
    rows, variants = _under_variants(project, _tier(project, words))
    refuted = [row for row in rows if row.plain is Tally.REFUTED and row.hangs_on]
    others = [one for one in Tally if any(row.outcomes[name] is one for row in refuted for name in row.hangs_on)]
    cells = {
        name: [
            ", ".join(row.claim for row in refuted if name in row.hangs_on and row.outcomes[name] is other)
            for other in others
        ]
        for name in variants
    }
    head = f"{plural(len(refuted), 'refuted case')} of the {_tier(project, words)} tier end otherwise under a variant:"
    found = ((name, *(cell or NONE for cell in line)) for name, line in cells.items() if any(line))
    return f"{head}\n\n{table(('variant', *others), (map(literal, line) for line in found))}"


def _under_variants(project: Project, tier: str) -> tuple[tuple[Robustness, ...], list[str]]:
    variants = list(project.reproduction.variants)
    plain, *varied = project.judge_variants([(tier, name) for name in ("", *variants)])
    return matrix(plain, dict(zip(variants, varied, strict=True))), variants


def _tier(project: Project, words: list[str]) -> str:
    """Return the tier that a table is of: the last one unless it is named."""
    tier, *more = words or list(project.reproduction.tiers)[-1:]
    if more:
        raise UserError(f"A table of this kind shows one tier, not {', '.join(words)}. Write one table for each.")
    project.reproduction.tier(tier)
    return tier


def _robustness(rows: Sequence[Robustness], variants: Sequence[str]) -> str:
    """Return one line per claim and a column per variant; a verdict that differs from the protocol's is bold."""
    return table(
        ("claim", "tier", "the protocol", *map(literal, variants)),
        (
            (
                literal(row.claim),
                literal(row.tier),
                literal(row.plain),
                *(
                    f"**{literal(row.outcomes[name])}**"
                    if name in row.hangs_on
                    else literal(row.outcomes.get(name, NONE))
                    for name in variants
                ),
            )
            for row in rows
        ),
    )


def _numbers(project: Project, words: list[str], *_: str) -> str:
    """Return the published numbers beside ours; the words are a tier and, for the variants too, "all"."""
    tier, *rest = words or list(project.reproduction.tiers)[-1:]
    variants = ("", *project.reproduction.variants) if rest else ("",)
    found = replications(project.archive, project.reproduction, tier, variants)
    (papers,) = project.judge_sessions([(project.as_published(tier), tier)])
    lines = [*replication_cells.totals(found), *replication_cells.put_to_the_paper(papers)]
    return "\n\n".join((replication_cells.markdown(found), "\n".join(f"* {literal(line)}" for line in lines)))


_KINDS: Final[Mapping[str, Callable[[Project, list[str], str], str]]] = {
    "verdicts": lambda project, words, _: overview(*_columns(project, words), Reader(project.archive)),
    # Of the sentences that the table before has chosen and shortened, or of all.
    "marks": lambda project, words, before: marks(*_columns(project, words), short_sentences(before)),
    "sentences": _of_a_tier(lambda reports: by_sentence(sentences([one for one in reports if not one.is_control]))),
    "tally": _of_a_tier(tally),
    "details": _details,
    "refutations": _refutations,
    "numbers": _numbers,
    "readings": _of_a_tier(verdict_overview.readings),
    "uncovered": lambda project, *_: verdict_overview.without_claims(uncovered(project.reproduction.folder)),
    "measures": lambda project, *_: vocabulary.measures(project.reproduction.trials),
    "assertions": lambda *_: vocabulary.assertions(),
    "commands": lambda *_: reference(),
}
"""What makes each kind of table, from the project, the words behind its name, and the table that was there before."""
