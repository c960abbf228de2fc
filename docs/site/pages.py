"""Pages of the site that are no files of docs/: files of the root, and the reference of the public names.

README and its like are written for readers of the repository, so links are mended here: those to pages lead there, and
those to code become plain text. A link to a file that does not exist ends the build.
"""

from __future__ import annotations

import ast
import posixpath
import re
from functools import partial
from pathlib import Path
from typing import Final

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT: Final = Path(__file__).parents[2]
OF_THE_ROOT: Final = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}
"""Pages by the files that they are."""

_LINK: Final = re.compile(r"```.*?```|<!--.*?-->|(!?\[[^\]]*\])\(([^)\s#]+)(#[^)\s]*)?\)", re.DOTALL)
_PACKAGE: Final = re.compile(r"^## `([\w.]+)`$", re.MULTILINE)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages."""
    for name, page in OF_THE_ROOT.items():
        files.append(File.generated(config, page, content=(ROOT / name).read_text(encoding="utf-8")))
    for package in _PACKAGE.findall((ROOT / "docs" / "api.md").read_text(encoding="utf-8")):
        files.append(File.generated(config, f"reference/{package}.md", content=_reference(package)))
    return files


def _reference(package: str) -> str:
    """Return the page of a package: each public name with its docstring, from the module that has it."""
    stub = ROOT.joinpath("src", *package.split("."), "__init__.pyi").read_text(encoding="utf-8")
    lines = [line for line in ast.parse(stub).body if isinstance(line, ast.ImportFrom)]
    names = sorted((alias.name, str(line.module)) for line in lines for alias in line.names)
    return "\n\n".join([f"# `{package}`", *(_entry(name, module) for name, module in names)]) + "\n"


def _entry(name: str, module: str) -> str:
    """Return what the reference has of a name: its docstring; of one of several values in a line, the name alone."""
    text = (ROOT / "src" / f"{module.replace('.', '/')}.py").read_text(encoding="utf-8")
    if re.search(rf"^((class|def) )?{name}\b(?!,)", text, re.MULTILINE):
        return f"::: {module}.{name}"
    return f"## `{name}`\n\nSee [the public names](../api.md)."


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Mend the links of a page."""
    return _LINK.sub(partial(_mended, page.file.src_uri), markdown)


def _mended(page: str, link: re.Match[str]) -> str:
    """Return a link of a page as the site needs it; code, comments and links to elsewhere stay as they are."""
    text, target, anchor = link[1], link[2], link[3] or ""
    if text is None or "://" in target or target.startswith("mailto:"):
        return link[0]
    source = {there: name for name, there in OF_THE_ROOT.items()}.get(page, f"docs/{page}")
    path = posixpath.normpath(posixpath.join(posixpath.dirname(source), target))
    if not (ROOT / path).exists():
        raise PluginError(f"{source} links to {target}, which does not exist.")
    there = OF_THE_ROOT.get(path, path.removeprefix("docs/") if path.startswith("docs/") else "")
    return f"{text}({posixpath.relpath(there, posixpath.dirname(page) or '.')}{anchor})" if there else text.strip("[]")
