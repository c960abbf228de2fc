"""The released versions of a package, oldest first, as pip's index of packages lists them."""

from __future__ import annotations

import re
import subprocess
import sys

from packaging.version import Version

from evoclaims.core.environments import PIP, reason
from evoclaims.core.errors import UserError


def released(package: str) -> list[str]:
    """Return all final releases that this Python can use.

    Raises:
        UserError: when pip finds none.
    """
    command = [sys.executable, *PIP, "index", "versions", package]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    listed = re.search(r"^Available versions: (.*)$", done.stdout, re.MULTILINE)
    if listed is None:
        why = reason(done.stdout + done.stderr)
        raise UserError(f"pip lists no releases of {package} ({why}). Name them on the command line.")
    return sorted(listed[1].split(", "), key=Version)


def between(first: str, last: str, releases: list[str]) -> list[str]:
    """Return releases from one to another, both included, in order.

    Raises:
        UserError: when the first is not older than the last.
    """
    low, high = Version(first), Version(last)
    if not low < high:
        raise UserError(f"{first} is not older than {last}. Name the older release first.")
    inner = sorted((one for one in releases if low < Version(one) < high), key=Version)
    return [first, *inner, last]
