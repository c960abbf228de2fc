"""The function that XLA calls to run a kernel on a processor, as LLVM's text.

XLA's foreign function interface is a stable ABI (`c_api.h` of jaxlib): the handler written here takes the arrays'
addresses out of the call frame.
"""

from __future__ import annotations

from typing import Final

ENTRY: Final = "handler"
"""The symbol that XLA calls."""
EXTENSION_START, API, ARGUMENTS, RESULTS = 8, 16, 72, 112
"""Offsets, in bytes, in XLA_FFI_CallFrame: the extensions, the API, the arrays of pointers to buffers."""
DATA: Final = 24
"""Offset of the address of the data in XLA_FFI_Buffer."""
METADATA: Final = 24
"""Offset of the address of XLA_FFI_Metadata in the extension that asks for it."""
API_VERSION: Final = 32
"""Offset of the version (major, minor) in XLA_FFI_Api."""
METADATA_VERSION: Final = 24
"""Offset of the version (major, minor) in XLA_FFI_Metadata."""


def handler(counts: int, arrays: int, results: int) -> str:
    """Return the text of the function that XLA calls.

    It calls the function `work` with the numbers of the first argument, an array of `counts` int32, as i64; then with
    the addresses of the other arguments and of the results.
    """
    lines = [
        f"define ptr @{ENTRY}(ptr %frame) nounwind {{",
        "entry:",
        *_loaded("%extension", "ptr", "%frame", EXTENSION_START),
        *_loaded("%api", "ptr", "%frame", API),
        "%called = icmp eq ptr %extension, null",
        "br i1 %called, label %call, label %asked",
        "asked:",  # XLA asks which version of the interface this is: the fields read here are in all of them
        *_loaded("%metadata", "ptr", "%extension", METADATA),
        *_loaded("%version", "i64", "%api", API_VERSION),
        f"%answer = getelementptr i8, ptr %metadata, i64 {METADATA_VERSION}",
        "store i64 %version, ptr %answer",
        "ret ptr null",
        "call:",
        *_loaded("%arguments", "ptr", "%frame", ARGUMENTS),
        *_loaded("%results", "ptr", "%frame", RESULTS),
        *_buffer("%layout", "%arguments", 0),
    ]
    for place in range(counts):
        lines += [
            *_loaded(f"%n{place}.short", "i32", "%layout", 4 * place),
            f"%n{place} = zext i32 %n{place}.short to i64",
        ]
    for place in range(arrays):
        lines += _buffer(f"%a{place}", "%arguments", 1 + place)
    for place in range(results):
        lines += _buffer(f"%z{place}", "%results", place)
    given = [f"i64 %n{place}" for place in range(counts)]
    given += [f"ptr %a{place}" for place in range(arrays)] + [f"ptr %z{place}" for place in range(results)]
    lines += [f"call void @work({', '.join(given)})", "ret ptr null", "}"]
    return "\n".join(lines) + "\n"


def _loaded(register: str, type_: str, address: str, offset: int) -> list[str]:
    """Return instructions that read a field of a struct."""
    at = f"{register}.at"
    return [f"{at} = getelementptr i8, ptr {address}, i64 {offset}", f"{register} = load {type_}, ptr {at}"]


def _buffer(register: str, buffers: str, place: int) -> list[str]:
    """Return instructions that read the address of the data of a buffer."""
    return [
        *_loaded(f"{register}.buffer", "ptr", buffers, 8 * place),
        *_loaded(register, "ptr", f"{register}.buffer", DATA),
    ]
