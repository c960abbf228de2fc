"""Takes the kernels for GPUs out of lowered programs, and assembles them where NVIDIA's assembler is installed."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import jax
import pytest


def kernels_for_gpus(function: Any, *arguments: Any) -> list[str]:
    """Return the PTX of every kernel of a function lowered for NVIDIA's GPUs."""
    lowered = jax.jit(function).trace(*arguments).lower(lowering_platforms=("cuda",)).as_text()
    texts = re.findall(r'kernel_data = "([^"]*)"', lowered)
    return [re.sub(r"\\([0-9A-F]{2})", lambda code: chr(int(code[1], 16)), text) for text in texts]


def assemble(ptx: str, folder: Path) -> None:
    """Assemble a kernel; skip the test where there is no assembler."""
    if shutil.which("ptxas") is None:
        pytest.skip("needs NVIDIA's assembler, ptxas")
    (folder / "kernel.ptx").write_text(ptx)
    command = ["ptxas", "-arch=sm_80", "kernel.ptx", "-o", "kernel.cubin"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr
