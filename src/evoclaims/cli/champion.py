"""`evoclaims champion`: a stored trial's champion, examined once more, drawn or exported."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Final, get_args

from evoclaims.cli.project import open_project
from evoclaims.cli.stored_trial import Stored, describe, load
from evoclaims.cli.terminal import FIGURES, styled, write
from evoclaims.core.drawing import Format
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.networks import export
from evoclaims.report.champion import network
from evoclaims.report.console import PlainSpokenConsole, plain_table
from evoclaims.trials import champions, devices
from evoclaims.trials.champions import Replay


def main(options: argparse.Namespace) -> int:
    """Replay and, with --as, write; 1 when the replay differs from the record."""
    if options.form is not None and options.form not in FORMS:
        raise UnknownNameError("form of a network", options.form, FORMS)
    if options.out is not None and options.form is None:
        raise UserError(f"--out names the file that --as writes; add --as {', '.join(FORMS)}.")
    project, chosen = open_project(options.storage), devices.choose(options.device)
    trial = load(project, options.tier, options.method, options.on, options.seed)
    made = None
    if options.form is not None:
        made = FORMS[options.form](trial)
        if made is None:
            raise UserError(
                f"A champion of {options.method} has arrays of parameters and no genome, so there is no "
                f"graph to write as {options.form}. Leave --as out to replay it; its arrays are in "
                f"{trial.file}."
            )
    replay = champions.replay(trial.condition, trial.result, trial.parameters, chosen)
    print(f"{trial.title}\n  {describe(trial.result)}")
    # Each value as recorded and as replayed, to the last digit of a float32.
    columns = [values[name] for name in ("success", "fitness") for values in (replay.again, replay.recorded)]
    rows = (
        [str(level), *(f"{value + 0.0:.9g}" for value in row)] for level, row in enumerate(zip(*columns, strict=True))
    )
    headings = ("level", "success", "recorded", "fitness", "recorded")
    PlainSpokenConsole(file=styled()).print(plain_table(headings, rows, names=0))
    print(_judgement(replay))
    if made is not None:
        default = FIGURES / f"{options.method}-{options.on}-{options.seed}.{options.form}"
        path = Path(default if options.out is None else options.out)
        write(path, made, ours=options.out is None)
        print(f"wrote {path}")
    return int(not replay.exact)


def _json(trial: Stored) -> bytes | None:
    """Return a champion's genome as JSON; None for one without a graph."""
    graph = champions.network_of(trial.condition, trial.parameters)
    return None if graph is None else export.to_json(trial.parameters, graph).encode()


def _picture(trial: Stored, file_format: Format) -> bytes | None:
    """Draw a champion's network; None for one without a graph."""
    title = f"{trial.title}, seed {trial.result.seed}"
    return network(trial.condition, trial.result, trial.parameters, title, file_format)


FORMS: Final[Mapping[str, Callable[[Stored], bytes | None]]] = {
    "json": _json,
    **{file_format: partial(_picture, file_format=file_format) for file_format in get_args(Format)},
}


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
