"""The report as one HTML page that needs no network: it includes style, script and pictures."""

from __future__ import annotations

import base64
import functools
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import resources
from typing import Final

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from evoclaims.core.content_policy import exactly
from evoclaims.judging.verdict import Outcome
from evoclaims.report import charts, formatting, replication_cells
from evoclaims.report.fault_grid import LEGEND
from evoclaims.report.model import Page

_VIEW_BOX: Final = re.compile(rb'viewBox="[-\d.]+ [-\d.]+ ([\d.]+) ([\d.]+)"')


@dataclass(frozen=True)
class Shown:
    """A drawing that is kept once and shown in several places.

    Attributes:
        name: its id in the page.
        width, height: in the drawing's own units.
        label: in words.
    """

    name: str
    width: float
    height: float
    label: str


def html(page: Page) -> str:
    """Return the whole page."""
    style, script = _asset("report.css"), _asset("report.js")
    shelf, curves, champions = _shelf(page)
    return (
        _environment()
        .get_template("page.html.j2")
        .render(
            page=page,
            outcomes=list(Outcome),
            legend=LEGEND,
            style=style,
            script=script,
            policy=policy(style, script),
            shelf=shelf,
            curves=curves,
            champions=champions,
            places=_choices(place for section in page.sections for place in section.places),
            methods=_choices(method for section in page.sections for method in section.methods),
        )
    )


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
        "number": formatting.number,
        "p_value": formatting.p_value,
        "json": _json,
        "data_uri": data_uri,
    }
    environment.globals |= {"strip_svg": charts.strip_svg, "axis_svg": charts.axis_svg, "plural": formatting.plural}
    environment.globals |= {"replication": replication_cells, "profile_svg": charts.profile_svg}
    return environment


def _cleaned(value: object) -> object:
    """Return what a template shows without control characters; markup is unchanged."""
    return formatting.clean(value) if isinstance(value, str) and not isinstance(value, Markup) else value


def policy(style: str, script: str) -> str:
    """Return the page's Content-Security-Policy: nothing from outside, and no script or style but its own."""
    return (
        f"default-src 'none'; img-src data:; style-src {exactly(style)}; script-src {exactly(script)}; "
        "base-uri 'none'; form-action 'none'"
    )


def data_uri(svg: bytes) -> str:
    """Return an SVG as a data URI; as an image it can neither run scripts nor load anything."""
    return f"data:image/svg+xml;base64,{base64.b64encode(svg).decode()}"


def _shelf(page: Page) -> tuple[Markup, Mapping[str, list[Shown]], Mapping[str, Shown]]:
    """Return all drawings that sections share, and which of them belong to each condition."""
    kept: list[Markup] = []
    curves: dict[str, list[Shown]] = {}
    champions: dict[str, Shown] = {}
    for number, (key, condition) in enumerate(page.conditions.items()):
        curves[key] = []
        for index, panel in enumerate(condition.curves):
            name = f"curves-{number}-{index}"
            kept.append(charts.curve_symbol(panel, name))
            curves[key].append(Shown(name, *charts.PANEL, f"{panel.name} over training, {condition.label}"))
        picture = condition.champion.picture
        size = _VIEW_BOX.search(picture)
        if size is not None:
            shown = Shown(f"champion-{number}", float(size[1]), float(size[2]), condition.champion.says)
            champions[key] = shown
            kept.append(
                Markup('<image id="{}" width="{}" height="{}" href="{}"/>').format(
                    shown.name, shown.width, shown.height, data_uri(picture)
                )
            )
    return Markup("\n").join(kept), curves, champions


def _choices(values: Iterator[str]) -> list[str]:
    """Return each value once, sections of the paper first and in their order."""
    return sorted(set(values), key=formatting.place_key)


def _json(value: object) -> str:
    """Return a value as JSON for an attribute, which the template then escapes."""
    return json.dumps(value)


def _asset(name: str) -> Markup:
    """Return a file of the package as it is."""
    return Markup((resources.files("evoclaims.report") / "assets" / name).read_text(encoding="utf-8"))  # noqa: S704
