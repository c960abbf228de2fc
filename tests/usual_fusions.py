"""A compiler's option for programs whose bits are compared with those of other programs: XLA's usual fusions."""

from __future__ import annotations

import os
from typing import Final

_FLAG: Final = "xla_cpu_use_fusion_emitters"
USUAL_FUSIONS: Final = {_FLAG: True} if f"--{_FLAG}=false" in os.environ.get("XLA_FLAGS", "") else None
"""For `jax.jit(..., compiler_options=...)`: without them, as conftest.py asks, XLA rounds by what surrounds a sum."""
