"""What the project says of itself to packagers, and to those who cite it."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

# Version 1.2.0 of the Citation File Format, as far as it is used here.
REQUIRED = {"cff-version", "message", "title", "authors"}
KNOWN = REQUIRED | {"type", "abstract", "version", "license", "keywords", "references", "date-released", "doi", "url"}
REQUIRED_OF_REFERENCE = {"type", "title", "authors"}
KNOWN_OF_REFERENCE = REQUIRED_OF_REFERENCE | {"collection-title", "year", "doi", "url", "pages", "publisher"}
PERSON = {"family-names", "given-names", "name-particle", "name-suffix", "orcid", "affiliation", "email", "website"}
ENTITY = {"name", "website", "email", "orcid"}


@pytest.fixture(scope="module")
def citation() -> dict[str, Any]:
    """CITATION.cff."""
    plain: dict[str, Any] = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    return plain


def test_the_citation_is_of_its_format(citation: dict[str, Any]) -> None:
    assert REQUIRED <= citation.keys() <= KNOWN
    assert citation["cff-version"] == "1.2.0"
    assert citation["type"] in {"software", "dataset"}
    for reference in citation["references"]:
        assert REQUIRED_OF_REFERENCE <= reference.keys() <= KNOWN_OF_REFERENCE
        assert isinstance(reference["year"], int)
    for author in (
        *citation["authors"],
        *(one for reference in citation["references"] for one in reference["authors"]),
    ):
        assert author
        assert author.keys() <= PERSON or ("name" in author and author.keys() <= ENTITY)
        assert all(isinstance(value, str) for value in author.values())


def test_the_citation_says_what_the_package_says(citation: dict[str, Any]) -> None:
    assert citation["title"] == PROJECT["name"]
    assert citation["version"] == PROJECT["version"]
    assert citation["license"] == PROJECT["license"]
    assert citation["abstract"] == PROJECT["description"]
    assert citation["keywords"] == PROJECT["keywords"]
    assert [author["name"] for author in citation["authors"]] == [author["name"] for author in PROJECT["authors"]]


def test_the_paper_cited_is_the_one_under_test(citation: dict[str, Any]) -> None:
    from reproductions.nisioti2025 import REPRODUCTION

    (paper,) = citation["references"]
    assert paper["title"] == REPRODUCTION.title
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert ",\n".join(author["family-names"] for author in paper["authors"]).replace("\n", " ") in " ".join(
        readme.split()
    )
