"""Files of a project at a git revision: read through git, never checked out; none of their code is run."""

from __future__ import annotations

import os
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from evoclaims.core.errors import UserError

GIT_SECONDS: Final = 60.0
"""How long one call of git may take."""


@dataclass(frozen=True)
class GitRevision:
    """A commit of the repository that contains a folder.

    Attributes:
        name: as the user wrote it.
        sha: the commit's full name.
        folder: paths are relative to it.
    """

    name: str
    sha: str
    folder: Path

    def read(self, path: str) -> bytes | None:
        """Return a file's content; None when the revision does not have it.

        Raises:
            UserError: when git fails.
        """
        return self._git("cat-file", "blob", f"{self.sha}:./{path}") if path in self.files(path) else None

    def files(self, path: str) -> tuple[str, ...]:
        """Return the files at and below a path, sorted.

        Raises:
            UserError: when git fails.
        """
        listed = self._git("ls-tree", "-r", "-z", "--name-only", self.sha, "--", path)
        return tuple(sorted(os.fsdecode(name) for name in listed.split(b"\0") if name))

    def _git(self, *arguments: str) -> bytes:
        """Return what git prints."""
        done = run_git(self.folder, *arguments)
        if done.returncode:
            reason = " ".join(done.stderr.decode(errors="replace").split())
            raise UserError(f"git cannot read the revision {self.name}: {reason}.")
        return done.stdout


def find_revision(name: str, folder: Path) -> GitRevision | None:
    """Return the commit that a name means (a branch, a tag, HEAD~3, …), or None.

    Raises:
        UserError: when git is missing or too slow, or `folder` is not in a repository.
    """
    inside = run_git(folder, "rev-parse", "--is-inside-work-tree")
    if inside.returncode or inside.stdout.strip() != b"true":
        raise UserError(
            f"{folder} is not in a git repository, so there is no revision to compare with. Compare two "
            "stores instead, or `evoclaims compare` alone: current verdicts with accepted ones."
        )
    if not name or "\0" in name:
        return None
    # A name that begins with a dash must not be taken for an option; from here on only the commit's hash is used.
    found = run_git(folder, "rev-parse", "--verify", "--quiet", "--end-of-options", f"{name}^{{commit}}")
    sha = found.stdout.decode(errors="replace").strip()
    known = found.returncode == 0 and re.fullmatch(r"[0-9a-f]{40,64}", sha) is not None
    return GitRevision(name, sha, folder) if known else None


def run_git(folder: Path, *arguments: str) -> subprocess.CompletedProcess[bytes]:
    """Run a read-only git command in a folder, without a shell.

    Raises:
        UserError: when git is missing or too slow.
    """
    try:
        return subprocess.run(
            ["git", "-c", "core.fsmonitor=false", *arguments],
            cwd=folder,
            capture_output=True,
            stdin=subprocess.DEVNULL,
            timeout=GIT_SECONDS,
            check=False,
            env={**os.environ, "GIT_OPTIONAL_LOCKS": "0", "LC_ALL": "C"},
        )
    except OSError as error:
        raise UserError(f"Revisions are read by git, which does not start: {error.strerror or error}.") from error
    except subprocess.TimeoutExpired as error:
        raise UserError(f"git gave no answer within {GIT_SECONDS:g} seconds.") from error
