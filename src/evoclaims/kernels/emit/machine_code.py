"""LLVM's text as machine code of this processor, compiled once a machine and kept beside XLA's compiled programs."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, Final

import jax
from filelock import FileLock

from evoclaims.core.errors import UserError
from evoclaims.core.files import ForeignFileError, doubt, make_private, read_private, say_refused, write_atomically
from evoclaims.core.waiting import waiting
from evoclaims.kernels.trace.expressions import Unsupported

try:
    import llvmlite.binding as binding
except ImportError:  # not every machine has a wheel of it; `lanes` says so
    binding = None
llvm: Any = binding

OPTIMIZATION: Final = 2
"""Of choosing instructions and registers; the text itself is compiled as it is."""
VECTORS: Final = {"avx512f": 16, "avx2": 8}
"""Numbers in a vector register, by the processor's feature that brings it; others have 4."""
CHECKSUM: Final = hashlib.sha256().digest_size
PATIENCE: Final = 60.0
"""Seconds to wait for another process that compiles the same text: it may be stopped, or hang."""

_libraries: dict[str, Any] = {}
"""Machine code in memory by its key, for ever: XLA's programs call it."""


@cache
def lanes() -> int:
    """Return how many float32 or int32 a vector register of this processor holds.

    Raises:
        Unsupported: when LLVM cannot be imported.
    """
    if llvm is None:
        raise Unsupported("the package llvmlite, which is not installed")
    return next((count for feature, count in VECTORS.items() if llvm.get_host_cpu_features().get(feature)), 4)


def key_of(text: str) -> str:
    """Return the name of a text's machine code: a hash of text, processor and LLVM's version."""
    processor = llvm.get_process_triple(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    return hashlib.sha256(repr((*processor, llvm.llvm_version_info, OPTIMIZATION, text)).encode()).hexdigest()[:32]


def address(text: str, symbol: str) -> int:
    """Return the address of a function of LLVM's text in this process's memory."""
    key = key_of(text)
    if key not in _libraries:
        library = llvm.JITLibraryBuilder().add_object_img(_machine_code(key, text)).add_current_process()
        _libraries[key] = library.export_symbol(symbol).link(_linker(), key)
    return int(_libraries[key][symbol])


def compiled(text: str) -> bytes:
    """Return the text's machine code, an object file."""
    module = llvm.parse_assembly(text)
    module.verify()
    return bytes(_target().emit_object(module))


@cache
def _target() -> Any:
    """Return the machine that is compiled for: this one."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(
        llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten(), OPTIMIZATION, reloc="pic", codemodel="small"
    )


@cache
def _linker() -> Any:
    """Return what puts machine code into memory."""
    _target()
    # It puts code and constants side by side; the older linker may put them farther apart than code can reach.
    return llvm.create_lljit_compiler(use_jit_link=True)


def _machine_code(key: str, text: str) -> bytes:
    """Return a text's machine code from the cache on disk, where jax's configuration names one, or compile it."""
    config: Any = jax.config  # defines its attributes at run time
    folder = config.jax_compilation_cache_dir
    if folder is None or not _is_private(Path(folder) / "kernels"):
        return compiled(text)
    path = Path(folder) / "kernels" / f"{key}.o"
    kept = _kept(path)
    if kept is not None:
        return kept
    with _alone(path):
        code = _kept(path) or compiled(text)  # another process may have compiled it meanwhile
        with contextlib.suppress(UserError):  # a full or read-only disk costs time alone
            write_atomically(path, hashlib.sha256(code).digest() + code, mode=0o600)
    return code


def _is_private(folder: Path) -> bool:
    """Whether only this user can put machine code into a folder, which is made where it is missing."""
    try:
        make_private(folder)
        if why := doubt(folder.parent) or doubt(folder):
            say_refused(folder, why)
        return not why
    except OSError:  # a read-only disk, or a file in its place
        return False


def _kept(path: Path) -> bytes | None:
    """Return the machine code in a file, or None if it is missing, damaged, or another user may have written it."""
    try:
        data = read_private(path)
    except ForeignFileError as error:
        say_refused(path, str(error))
        return None
    except OSError:
        return None
    code = data[CHECKSUM:]
    return code if hashlib.sha256(code).digest() == data[:CHECKSUM] else None


@contextlib.contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Let one process at a time compile what `path` will hold; where no lock can be had in time, all do."""
    lock = FileLock(path.with_suffix(".lock"), timeout=PATIENCE)
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError), waiting():  # filelock's Timeout is one: its owner may be stopped, or hang
            stack.enter_context(lock)
        yield
