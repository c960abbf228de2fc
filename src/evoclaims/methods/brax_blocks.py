"""The parts of Brax that PPO is made of, imported in one place."""

from __future__ import annotations

import contextlib
import io

# MJX, which Brax imports, prints two lines when NVIDIA's warp is not installed; nothing here uses warp.
with contextlib.redirect_stdout(io.StringIO()):
    from brax.training.acme import running_statistics, specs
    from brax.training.agents.ppo import losses, networks
    from brax.training.types import Transition

__all__ = ["Transition", "losses", "networks", "running_statistics", "specs"]
