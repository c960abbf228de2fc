"""What records, claims and arguments say reaches a terminal as text: by every command, and by pytest."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from evoclaims.cli import main
from evoclaims.core.canonical import content_hash
from evoclaims.trials.store import Store
from evoclaims.verdicts import history

HOSTILE = "\x1b[2J\x1b]0;owned\x07\x9b31m\u202e\r"

READING = (
    ("accept",),
    ("status",),
    ("plan",),
    ("verify", "--dry-run"),
    ("compare",),
    ("export", "--as=csv"),
    ("status", "--as=csv"),
    ("report",),
    ("champion", "right", "--on=parity"),
    ("run", "right", "--trials=10"),
    ("compare", "."),
    ("compare", HOSTILE),
    ("export", "--as=" + HOSTILE),
    ("status", "--storage=" + HOSTILE),
    ("status", "--" + HOSTILE),
)


def texts(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield where the texts are in plain JSON."""
    if isinstance(value, str):
        yield path
    for name, part in value.items() if isinstance(value, dict) else ():
        yield from texts(part, (*path, name))


def with_hostile_texts(path: Path) -> None:
    """Put control characters into every text of a record that is not fixed by its specification, and seal it."""
    plain = json.loads(path.read_text())
    for part in ("timing", "provenance"):
        for *way, last in list(texts(plain[part])):
            table = plain[part]
            for name in way:
                table = table[name]
            table[last] = HOSTILE + table[last]
        plain[part][HOSTILE] = HOSTILE
    plain["provenance"]["versions"][HOSTILE] = HOSTILE
    for part in ("metrics", "levels", "curves"):
        values = next(iter(plain[part].values()))
        plain[part][HOSTILE] = values
    plain["seal"] = content_hash({key: value for key, value in plain.items() if key != "seal"})
    path.write_text(json.dumps(plain, sort_keys=True, separators=(",", ":")))
    path.rename(path.with_name(f"{plain['id']}.json"))  # the name of records that do not say what they depend on


@pytest.fixture
def hostile(project: Any, stored: Store) -> Store:
    """The project's store, with control characters wherever a sealed record may hold them, and in a claim."""
    project.write(
        f"@claim('T1', says={HOSTILE!r}, where={HOSTILE!r}, smoke={HOSTILE!r})\n"
        "def test_it(trials, verdict):\n"
        "    verdict(trials('right', on='parity').solves_every_level.in_most_trials())\n\n"
        f"@claim('T2', says={HOSTILE!r}, where={HOSTILE!r}, smoke={HOSTILE!r})\n"
        "def test_error(trials, verdict):\n"
        f"    raise __import__('evoclaims.core.errors', fromlist=['x']).UserError({HOSTILE!r})\n\n"
        f"@expected(Outcome.REFUTED, because={HOSTILE!r})\n"
        f"@claim('T3', says={HOSTILE!r}, where={HOSTILE!r}, smoke={HOSTILE!r})\n"
        "def test_refuted(trials, verdict):\n"
        "    verdict(trials('wrong', on='parity').solves_every_level.in_most_trials())\n"
    )
    for path in list(stored.record_paths()):
        with_hostile_texts(path)
    damaged = stored.record_path("0" * 64)
    damaged.parent.mkdir(exist_ok=True)
    damaged.write_text(json.dumps({"schema": HOSTILE}))
    (stored.root / "trials" / "\x1b[31m").touch()
    return stored


def steering(text: str) -> set[str]:
    """Return the characters of an output that are neither printable nor ends of lines."""
    return {c for c in text if not c.isprintable() and c != "\n"}


def test_no_text_of_a_record_or_an_argument_steers_the_terminal_or_files_for_people(
    hostile: Store, capfd: pytest.CaptureFixture[str]
) -> None:
    capfd.readouterr()
    for arguments in READING:
        with contextlib.suppress(SystemExit):  # the parser's
            main(arguments)
        out, err = capfd.readouterr()
        assert out + err, arguments
        assert "Traceback" not in out + err, arguments
        assert steering(out + err) == set(), arguments
    for name in ("report/trials.csv", "report/index.html", history.FILE):
        text = Path(name).read_text()
        assert steering(text) - {"\t"} == set(), name


def test_no_text_steers_the_terminal_of_a_run(hostile: Store, project: Any) -> None:
    result = project.run(own_store=True)
    assert result.ret == 1
    text = result.stdout.str() + result.stderr.str()
    assert "T2" in text
    assert steering(text) == set()


COMMANDS = """
from evoclaims.cli import main
for arguments in (["status"], ["champion", "right", "--on", "parity"]):
    print("ended with", main(arguments), flush=True)
"""


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("-c", COMMANDS), ["ended with 1", "ended with 0"]),
        (("-m", "pytest", "-p", "no:cacheprovider", "--claims-stored"), []),
    ],
    ids=["evoclaims", "pytest"],
)
def test_a_terminal_that_knows_ascii_alone_is_told_the_same(
    project: Any, stored: Store, arguments: tuple[str, ...], said: list[str]
) -> None:
    project.write(a="supported", b="refuted")
    done = subprocess.run(
        [sys.executable, *arguments],
        env={**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        check=False,
    )
    text = (done.stdout + done.stderr).decode("ascii")
    lines = text.splitlines()
    assert "Traceback" not in text
    assert [line for line in lines if line.startswith("ended")] == said
    assert done.returncode == (0 if said else 1), text
    assert "+ supported" in text
    assert any(line.startswith("a ") and line.rstrip().endswith(("a.json", ")")) for line in lines)
