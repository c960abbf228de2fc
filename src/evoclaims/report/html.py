"""The report as one HTML page that needs no network: it includes style, script and pictures."""

from __future__ import annotations

import base64
import functools
import gzip
import json
from collections.abc import Iterator, Mapping
from importlib import resources
from typing import Final
from urllib.parse import quote

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from evoclaims.core.content_policy import exactly
from evoclaims.judging.verdict import Outcome
from evoclaims.report import across_table, charts, formatting, replication_cells, verdict_chart
from evoclaims.report.charts_of_verdicts import timeline_chart
from evoclaims.report.fault_grid import LEGEND
from evoclaims.report.model import Page, Section
from evoclaims.report.opening_lines import findings, opening_lines
from evoclaims.report.spark import spark_svg
from evoclaims.report.verdict_chart import VerdictChart
from evoclaims.verdicts.history import key_of

_FIGURES: Final = ("figures", "Figures", "Figures of the paper, redrawn")
_CHAPTERS: Final = (
    ("robustness", "Robustness", "Which conclusions hang on a detail?"),
    ("numbers", "Numbers", "Do the numbers replicate?"),
    ("faults", "Planted faults", "Which planted faults do the claims notice?"),
    ("across", "Releases", "Do other releases change a verdict?"),
    ("history", "History", "Accepted verdicts by date and versions"),
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
        yield f"all {name}", render(f"{name}.html.j2").render(page=page, legend=LEGEND)


def _chapters(page: Page) -> list[tuple[str, str, str]]:
    """Return the parts below the claims that have something to show."""
    return [one for one in _CHAPTERS if getattr(page, one[0]) or (one == _FIGURES and page.missing)]


def packed(pieces: Mapping[str, str]) -> Markup:
    """Return HTML by name as one text in the alphabet of base64: JSON, compressed with gzip.

    Evidence repeats the same words a thousand times, so that this is a tenth of the size. The same pieces give the same
    text.
    """
    plain = json.dumps(pieces, ensure_ascii=False, separators=(",", ":")).encode()
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
    environment.globals |= {"history_svg": history_svg, "chart_svg": chart_svg, "profile_svg": charts.profile_svg}
    environment.globals |= {"replication": replication_cells, "across_legend": across_table.LEGEND}
    return environment


def _cleaned(value: object) -> object:
    """Return what a template shows without control characters; markup is unchanged."""
    return formatting.clean(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def history_svg(section: Section) -> Markup:
    """Draw the accepted verdicts of one claim over dates and versions."""
    entries = tuple(entry for era in section.history for entry in era)
    return chart_svg(timeline_chart({key_of(section.report): entries}))


def chart_svg(chart: VerdictChart) -> Markup:
    """Draw a chart, whose texts are escaped there."""
    return Markup(verdict_chart.svg(chart))  # noqa: S704


def policy(style: str, script: str) -> str:
    """Return the page's Content-Security-Policy: nothing from outside, and no script or style but its own."""
    return (
        f"default-src 'none'; img-src data:; style-src {exactly(style)}; script-src {exactly(script)}; "
        "base-uri 'none'; form-action 'none'"
    )


def data_uri(svg: bytes) -> str:
    """Return an SVG as a data URI; as an image it can neither run scripts nor load anything.

    Its text stays as it is, apart from the signs that no URI may have: so pictures that are alike are packed well.
    """
    return f"data:image/svg+xml,{quote(svg, safe=' !$&()*+,-./:;=?@_~')}"


def _choices(values: Iterator[str]) -> list[str]:
    """Return each value once, sections of the paper first and in their order."""
    return sorted(set(values), key=formatting.place_key)


def _asset(name: str) -> Markup:
    """Return a file of the package as it is."""
    return Markup((resources.files("evoclaims.report") / "assets" / name).read_text(encoding="utf-8"))  # noqa: S704
