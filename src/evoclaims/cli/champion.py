"""`evoclaims champion`: a stored trial's champion, examined once more, drawn or exported."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from rich.table import Table

from evoclaims.cli.project import open_project
from evoclaims.cli.run import describe
from evoclaims.cli.stored import Stored, load, write
from evoclaims.cli.terminal import styled
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.networks import export, picture
from evoclaims.networks.genome import Genome
from evoclaims.networks.graph import GraphNetwork
from evoclaims.report.champion import network_panels
from evoclaims.report.console import PlainSpokenConsole
from evoclaims.trials import champions, devices
from evoclaims.trials.champions import Replay


@dataclass(frozen=True)
class ExportedGenome:
    """A champion that is a genome, as the forms of export take it.

    Attributes:
        trial: its trial.
        network: what the genome describes.
    """

    trial: Stored
    network: GraphNetwork

    @property
    def genome(self) -> Genome:
        """The genome."""
        genome: Genome = self.trial.parameters
        return genome

    @property
    def title(self) -> str:
        """Names the trial."""
        return f"{self.trial.title}, seed {self.trial.result.seed}"


def main(options: argparse.Namespace) -> int:
    """Replay and, with --as, write; 1 when the replay is not what the record says."""
    if options.form is not None and options.form not in FORMS:
        raise UnknownNameError("form of a network", options.form, FORMS)
    if options.out is not None and options.form is None:
        raise UserError(f"--out names the file that --as writes; add --as {', '.join(FORMS)}.")
    _, reproduction = open_project()
    tier, chosen = reproduction.tier(options.tier), devices.choose(options.device)
    trial = load(options.storage, tier, options.tier, options.method, options.on, options.seed)
    made = None
    if options.form is not None:
        network = champions.network_of(trial.condition, trial.parameters)
        if network is None:
            raise UserError(
                f"A champion of {options.method} is no genome but arrays of parameters, of which there is no graph to "
                f"write as {options.form}. Leave --as out to replay it; its arrays are in "
                f"{trial.file}."
            )
        made = FORMS[options.form](ExportedGenome(trial, network))
    replay = champions.replay(trial.condition, trial.result, trial.parameters, chosen)
    print(f"{trial.title}\n  {describe(trial.result)}")
    PlainSpokenConsole(file=styled()).print(_table(replay))
    print(_judgement(replay))
    if made is not None:
        default = f"{options.method}-{options.on}-{options.seed}.{options.form}"
        path = Path(default if options.out is None else options.out)
        write(path, made)
        print(f"wrote {path}")
    return int(not replay.exact)


def _json(exported: ExportedGenome) -> bytes:
    """Return the genome as JSON."""
    return export.to_json(exported.genome, exported.network).encode()


def _picture(file_format: picture.Format) -> Callable[[ExportedGenome], bytes]:
    """Return the function that draws a champion's network, and beside it the one that it draws on a substrate."""
    return lambda exported: picture.draw(
        network_panels(exported.trial.condition, exported.network, exported.genome), exported.title, file_format
    )


FORMS: Mapping[str, Callable[[ExportedGenome], bytes]] = {"json": _json, "svg": _picture("svg"), "png": _picture("png")}


def _table(replay: Replay) -> Table:
    """Build the table of levels: each value as recorded, and as it is now, to the last digit of a float32."""
    table = Table(box=None, pad_edge=False)
    for heading in ("level", "success", "recorded", "fitness", "recorded"):
        table.add_column(heading, justify="right")
    columns = [values[name] for name in ("success", "fitness") for values in (replay.again, replay.recorded)]
    for level, values in enumerate(zip(*columns, strict=True)):
        table.add_row(str(level), *(f"{value + 0.0:.9g}" for value in values))
    return table


def _judgement(replay: Replay) -> str:
    """Say whether the record holds, and if not, what may be why."""
    if replay.exact:
        return "The replay equals the stored record exactly."
    if replay.elsewhere:
        return (
            "The replay differs from the stored record, which was made with other "
            f"{', '.join(replay.elsewhere)}: rounding may differ there. Replay it where it was made to be sure."
        )
    return (
        "The replay differs from the stored record, which was made with the same versions on the same kind of machine: "
        "the code computes something else now, or the record is not this champion's."
    )
