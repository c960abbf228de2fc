"""The report as one HTML page that needs no network: it includes style, script and pictures."""

from __future__ import annotations

import base64
import functools
import gzip
import hashlib
import json
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from typing import Final
from urllib.parse import quote

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from evoclaims.judging.verdict import Outcome
from evoclaims.report import across, charts, formatting, replication_cells
from evoclaims.report.charts import spark_svg
from evoclaims.report.formatting import plural
from evoclaims.report.model import FATES, Page, Section
from evoclaims.verdicts.claim_report import APART, Tally
from evoclaims.verdicts.sentences import sentences
from evoclaims.verdicts.transitions import Robustness


@dataclass(frozen=True)
class OpeningLine:
    """One sentence, which may be judged in several cases.

    Attributes:
        claim: its id.
        sentence: the paper's own.
        place: the section of the paper; empty where the line above has the same.
        cases: in the order of the tiers.
        variants: its cases that were judged under each variant that was tried on some claim.
    """

    claim: str
    sentence: str
    place: str
    cases: tuple[Section, ...]
    variants: Mapping[str, tuple[Robustness, ...]] = field(default_factory=dict)

    def at(self, tier: str) -> tuple[Section, ...]:
        """Return its cases at a tier."""
        return tuple(section for section in self.cases if section.report.tier == tier)


def opening_lines(page: Page) -> list[OpeningLine]:
    """Return the lines in the order of the page's claims."""
    together: defaultdict[tuple[str, str], list[Section]] = defaultdict(list)
    for section in page.sections:
        together[section.report.claim, section.paper or section.report.statement].append(section)
    lines: list[OpeningLine] = []
    place = ""
    for (claim, sentence), cases in together.items():
        shown, place = "" if cases[0].places[0] == place else cases[0].places[0], cases[0].places[0]
        lines.append(OpeningLine(claim, sentence, shown, tuple(cases), _under_variants(page, cases)))
    return lines


def _under_variants(page: Page, cases: list[Section]) -> dict[str, tuple[Robustness, ...]]:
    names = {(section.report.name, section.report.tier) for section in cases}
    rows = [row for row in page.robustness if (row.claim, row.tier) in names]
    return {variant: tuple(row for row in rows if variant in row.outcomes) for variant in page.tried}


@dataclass(frozen=True)
class Finding:
    """Sentences of the paper that ended alike at a tier.

    Attributes:
        tier: where.
        kind: the name of their outcome in styles; empty where their cases ended differently.
        symbol: their outcome's; empty likewise.
        says: how many there are, in words.
        lines: the sentences.
    """

    tier: str
    kind: str
    symbol: str
    says: str
    lines: tuple[OpeningLine, ...]


def findings(page: Page, lines: Sequence[OpeningLine]) -> list[Finding]:
    """Return what came out, by sentence of the paper, at the first tier that has a verdict on one.

    A claim is counted once, and one that the result of another decides is not: as in `sentences`.
    """
    first = {line.claim: line for line in reversed(lines)}
    for board in page.boards:
        ended = [
            (first[one.claim], {case.counted_as for case in one.cases})
            for one in sentences(section.report for section in board.sections)
            if not one.same_as
        ]
        if any(tallies != {Tally.NOT_RUN} for _, tallies in ended):
            return list(_findings(board.tier, ended))
    return []


def _findings(tier: str, ended: Sequence[tuple[OpeningLine, set[Tally]]]) -> Iterator[Finding]:
    """Yield the sentences whose cases all have one outcome, by outcome, and then the others."""
    of = f"of {plural(len(ended), 'sentence')} ({tier})"
    for tally in Tally:
        if alike := tuple(line for line, outcomes in ended if outcomes == {tally}):
            says = f"{len(alike)} {of}: {tally} in every case"
            kind = Outcome.SUPPORTED.name if tally in APART else tally.name
            yield Finding(tier, kind.lower(), tally.symbol, says, alike)
    if others := tuple(line for line, outcomes in ended if len(outcomes) > 1):
        yield Finding(tier, "", "", f"{len(others)} {of}: cases end differently", others)


_FIGURES: Final = ("figures", "Figures", "Figures of the paper, redrawn")
_CHAPTERS: Final = (
    ("robustness", "Robustness", "Which conclusions hang on a detail?"),
    ("numbers", "Numbers", "Do the numbers replicate?"),
    ("faults", "Planted faults", "Which planted faults do the claims notice?"),
    ("across", "Releases", "Do other releases change a verdict?"),
    ("watch", "Nights", "Have trials changed, night by night?"),
    _FIGURES,
)
"""The parts below the claims, as a `Page` and a template call them; what leads there; and their titles."""


def html(page: Page) -> str:
    """Return the whole page."""
    style, script = _asset("report.css"), _asset("report.js")
    lines = opening_lines(page)
    return (
        _environment()
        .get_template("page.html.j2")
        .render(
            page=page,
            lines=lines,
            findings=findings(page, lines),
            chapters=_chapters(page),
            pieces=packed(dict(_pieces(page))),
            outcomes=list(Outcome),
            style=style,
            script=script,
            policy=policy(style, script),
            places=_choices(place for section in page.sections for place in section.places),
            methods=_choices(method for section in page.sections for method in section.methods),
        )
    )


def _pieces(page: Page) -> Iterator[tuple[str, str]]:
    """Yield what is shown on demand, by names of which no two are alike: a claim's anchor has no space."""
    render = _environment().get_template
    names = {key: str(number) for number, key in enumerate(page.conditions)}
    for section in page.sections:
        yield (
            section.anchor,
            render("evidence.html.j2").render(claim=section, names=names, protocols=page.protocols(section)),
        )
    for key, condition in page.conditions.items():
        yield f"trials {names[key]}", render("trials.html.j2").render(condition=condition)
        yield f"settings {names[key]}", render("settings.html.j2").render(condition=condition)
    for name, _, _ in _chapters(page):
        yield f"all {name}", render(f"{name}.html.j2").render(page=page, legend=FATES)


def _chapters(page: Page) -> list[tuple[str, str, str]]:
    return [one for one in _CHAPTERS if getattr(page, one[0]) or (one == _FIGURES and page.missing)]


def packed(pieces: Mapping[str, str]) -> Markup:
    """Return HTML by name as one text in the alphabet of base64: JSON, compressed with gzip.

    Evidence repeats the same words a thousand times, so that this is a tenth of the size. The same pieces give the same
    text. Names end with the tier: gzip looks back for 32 KB alone, and claims of one tier are alike.
    """
    alike = dict(sorted(pieces.items(), key=lambda piece: piece[0].rpartition("-")[::-1]))
    plain = json.dumps(alike, ensure_ascii=False, separators=(",", ":")).encode()
    return Markup(base64.b64encode(gzip.compress(plain, mtime=0)).decode())  # noqa: S704


@functools.cache
def _environment() -> Environment:
    """Return the templates, with the functions that they call."""
    environment = Environment(
        loader=PackageLoader("evoclaims.report"),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=_cleaned,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "clean": formatting.clean,
        "number": formatting.number,
        "p_value": formatting.p_value,
        "json": json.dumps,
        "data_uri": data_uri,
    }
    environment.globals |= {"strip_svg": charts.strip_svg, "axis_svg": charts.axis_svg, "curves_svg": charts.curves_svg}
    environment.globals |= {"spark_svg": spark_svg, "plural": formatting.plural}
    environment.globals |= {"replication": replication_cells, "across_legend": across.LEGEND}
    return environment


def _cleaned(value: object) -> object:
    """Return what a template shows without control characters; markup is unchanged."""
    return formatting.clean(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def policy(style: str, script: str) -> str:
    """Return the page's Content-Security-Policy: nothing from outside, and no script or style but its own."""
    return (
        f"default-src 'none'; img-src data:; style-src {_exactly(style)}; script-src {_exactly(script)}; "
        "base-uri 'none'; form-action 'none'"
    )


def data_uri(svg: bytes) -> str:
    """Return an SVG as a data URI; as an image it can neither run scripts nor load anything.

    Its text stays as it is, apart from the signs that no URI may have: so pictures that are alike are packed well.
    Coordinates have two decimals, a hundredth of a point: half of a picture is digits that nobody sees.
    """
    short = _COORDINATES.sub(lambda found: _UNSEEN.sub(rb"\1", found[0]), svg)
    return f"data:image/svg+xml,{quote(short, safe=' !$&()*+,-./:;=?@_~')}"


_COORDINATES: Final = re.compile(rb' (?:d|x|y|transform)="[^"]*"')
_UNSEEN: Final = re.compile(rb"(\.\d\d)\d+")


def _choices(values: Iterator[str]) -> list[str]:
    """Return each value once, sections of the paper first and in their order."""
    return sorted(set(values), key=formatting.place_key)


def _asset(name: str) -> Markup:
    return Markup((resources.files("evoclaims.report") / "assets" / name).read_text(encoding="utf-8"))  # noqa: S704


def _exactly(text: str) -> str:
    """Return what a Content-Security-Policy allows exactly this script or style by."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
