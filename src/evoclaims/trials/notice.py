"""Notices that a condition is being run, so that processes sharing a store do not run the same trials twice.

They are hints and not locks: a missed or lost notice costs repeated work, never a wrong record, so that every
failure to write one is passed over in silence.
"""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import socket
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Final

from evoclaims.core.errors import UserError
from evoclaims.core.files import read_file
from evoclaims.trials.heartbeat import beating
from evoclaims.trials.result_codec import is_hash

FRESH_SECONDS: Final = 60.0
"""A notice from another host counts for this long after its last refresh; here its process can be asked. One that was
stopped here (SIGSTOP, Ctrl-Z) may never go on: it counts for as long as if it were elsewhere."""

REFRESH_SECONDS: Final = 15.0
"""Time between two refreshes: some may come late on a slow network folder before the notice looks stale."""


@dataclass(frozen=True)
class Runner:
    """The process that a notice names.

    Attributes:
        pid: process number on `host`.
        host: network name of its machine.
        started: when it announced itself (UTC, ISO 8601).
        born: when the process started, as its system words it; tells it from a later process with the same
            number. Empty where the system does not say.
        token: random text that tells notices apart.
    """

    pid: int
    host: str
    started: str
    born: str
    token: str


@dataclass(frozen=True)
class Notice:
    """A notice for as long as a `with` block lasts; a stale one is taken over, a fresh one of another left alone.

    A thread refreshes it for other hosts, since a chunk of training or a compilation may take longer than they wait.

    Attributes:
        store_root: the store's folder.
        condition_id: the condition that is being run.
        token: random text that tells this notice from others.
    """

    store_root: Path
    condition_id: str
    token: str = field(default_factory=lambda: secrets.token_hex(8))
    _heart: contextlib.ExitStack = field(default_factory=contextlib.ExitStack, repr=False, compare=False)

    @property
    def path(self) -> Path:
        """Where the notice lies."""
        return notice_path(self.store_root, self.condition_id)

    @property
    def other(self) -> Runner | None:
        """Another process that is running the condition now: it was faster, so wait for it and look again."""
        return running_elsewhere(self.store_root, self.condition_id)

    @property
    def held(self) -> bool:
        """Whether the notice that lies there is this one."""
        runner = _read(self.path)
        return runner is not None and runner.token == self.token

    def refresh(self) -> None:
        """Say that the process is still at work, for those on other hosts."""
        if self.held:
            with contextlib.suppress(OSError):
                os.utime(self.path)

    def __enter__(self) -> Notice:
        """Announce this process, unless another that is at work has done so."""
        with contextlib.suppress(OSError):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            if not _place(self.path, self.token) and self.other is None:
                _clear(self.path)
                _place(self.path, self.token)
        if self.held:
            self._heart.enter_context(beating(self.refresh, REFRESH_SECONDS))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Take the notice away, if it is still this one."""
        self._heart.close()
        if self.held:
            with contextlib.suppress(OSError):
                self.path.unlink()
        sweep(self.store_root)


def notice_path(store_root: Path, condition_id: str) -> Path:
    """Return where the notice of a condition lies; a `UserError` for a text that is not an id."""
    if not is_hash(condition_id):
        raise UserError(f"{condition_id!r} is not a condition's id: an id is 64 lower-case hexadecimal digits.")
    return store_root / "running" / f"{condition_id}.json"


def sweep(store_root: Path) -> None:
    """Remove the notices of processes that are gone: of what they had finished nobody would look at them again."""
    for path in sorted((store_root / "running").glob("*.json")):
        if fresh(path) is None and not path.is_dir():
            _clear(path)


def running_elsewhere(store_root: Path, condition_id: str) -> Runner | None:
    """Return the other process that is running the condition, or None when there is none."""
    runner = fresh(notice_path(store_root, condition_id))
    if runner is None or (runner.host == socket.gethostname() and runner.pid == os.getpid()):
        return None
    return runner


def wait_while_others_run(
    store_root: Path,
    condition_id: str,
    tell: Callable[[str], None] = lambda text: None,
    poll: float = 0.2,
    sleep: Callable[[float], None] = time.sleep,
) -> bool:
    """Wait until no other process runs the condition; then look into the store again.

    Args:
        store_root: the store's folder.
        condition_id: the condition about to be run.
        tell: receives a line of progress at every look.
        poll: seconds between two looks.
        sleep: how to wait.

    Returns:
        Whether there was anything to wait for.
    """
    waited = False
    while (runner := running_elsewhere(store_root, condition_id)) is not None:
        waited = True
        tell(f"waiting for process {runner.pid} on {runner.host}, which runs the same trials since {runner.started}")
        sleep(poll)
    return waited


def fresh(path: Path) -> Runner | None:
    """Return the process that the notice `path` names if it is still at work, and None for a stale notice."""
    runner = _read(path)
    if runner is None:
        return None
    if runner.host == socket.gethostname() and os.name == "posix":
        if not _alive(runner):
            return None
        if _state(runner.pid)[0] not in ("T", "t"):
            return runner
    try:
        age = time.time() - path.stat().st_mtime
    except OSError:
        return None
    return runner if abs(age) < FRESH_SECONDS else None  # abs: a clock far ahead must not keep a notice for ever


def _read(path: Path) -> Runner | None:
    """Return what the notice says, or None when it is absent or not a notice."""
    try:
        plain = json.loads(read_file(path))
    except (OSError, ValueError, RecursionError):
        return None
    if not isinstance(plain, dict) or plain.keys() != Runner.__dataclass_fields__.keys():
        return None
    pid = plain.pop("pid")
    if isinstance(pid, bool) or not isinstance(pid, int) or pid < 1:  # 0 and below would address groups
        return None
    if not all(isinstance(value, str) for value in plain.values()):
        return None
    return Runner(pid=pid, **plain)


def _place(path: Path, token: str) -> bool:
    """Put this process's notice at `path`, whole at once; False when one lies there already."""
    runner = Runner(
        pid=os.getpid(),
        host=socket.gethostname(),
        started=datetime.now(UTC).isoformat(timespec="seconds"),
        born=_born(os.getpid()),
        token=token,
    )
    aside = _aside(path)
    try:
        aside.write_text(json.dumps(asdict(runner)), encoding="ascii")
        os.link(aside, path)
    except FileExistsError:
        return False
    finally:
        with contextlib.suppress(OSError):
            aside.unlink()
    return True


def _clear(path: Path) -> None:
    """Remove a stale notice; one that another process has put in its place meanwhile is put back."""
    aside = _aside(path)
    with contextlib.suppress(OSError):
        os.rename(path, aside)
        if fresh(aside) is not None:
            os.link(aside, path)
    with contextlib.suppress(OSError):
        aside.unlink()


def _aside(path: Path) -> Path:
    """Return a new name beside `path`, in the manner of `core.files`, so that leftovers are recognised."""
    return path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}.tmp")


def _alive(runner: Runner) -> bool:
    """Whether the process of a notice from this host still runs."""
    try:
        os.kill(runner.pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        pass  # it runs, under another user
    state, born = _state(runner.pid)
    return state not in ("Z", "X") and born == runner.born


def _born(pid: int) -> str:
    """Return when process `pid` started, in ticks since boot, or an empty text."""
    return _state(pid)[1]


def _state(pid: int) -> tuple[str, str]:
    """Return state letter and start of process `pid` from Linux's /proc; empty texts elsewhere.

    A killed process that its parent has not collected still answers signals: only its state, Z, gives it away.
    """
    try:
        text = Path(f"/proc/{pid}/stat").read_text(errors="replace")
    except OSError:
        return "", ""
    fields = text.rpartition(")")[2].split()  # the name before the bracket may hold spaces and brackets
    return fields[0], fields[19]
