"""`evoclaims champion`: a stored trial's champion, examined once more."""

from __future__ import annotations

import argparse

from evoclaims.cli.project import open_project
from evoclaims.cli.stored_trial import describe, load
from evoclaims.cli.terminal import styled
from evoclaims.report.console import PlainSpokenConsole, plain_table
from evoclaims.trials import champion_replay, devices
from evoclaims.trials.champion_replay import Replay


def main(options: argparse.Namespace) -> int:
    """Replay; 1 when the replay differs from the record."""
    project, chosen = open_project(options.storage), devices.choose(options.device)
    trial = load(project, options.tier, options.method, options.on, options.seed)
    replay = champion_replay.replay(trial.condition, trial.result, trial.parameters, chosen)
    print(f"{trial.title}\n  {describe(trial.result)}")
    # Each value as recorded and as replayed, to the last digit of a float32.
    columns = [values[name] for name in ("success", "fitness") for values in (replay.again, replay.recorded)]
    rows = (
        [str(level), *(f"{value + 0.0:.9g}" for value in row)] for level, row in enumerate(zip(*columns, strict=True))
    )
    headings = ("level", "success", "recorded", "fitness", "recorded")
    PlainSpokenConsole(file=styled()).print(plain_table(headings, rows, names=0))
    print(_judgement(replay))
    print(f"Its parameters, as numpy.load reads them: {trial.file}")
    return int(not replay.exact)


def _judgement(replay: Replay) -> str:
    """Say whether the replay matches the record, and if not, what may be why."""
    if replay.exact:
        return "The replay equals the stored record exactly."
    if replay.elsewhere:
        return (
            "The replay differs from the stored record, which was made with other "
            f"{', '.join(replay.elsewhere)}: rounding may differ there. Replay it where it was made to be sure."
        )
    return (
        "The replay differs from the stored record, which was made with the same versions on the same kind of machine: "
        "the code computes something else now, the record is not this champion's, or it is of an older release, which "
        "does not tell processors of one name apart."
    )
