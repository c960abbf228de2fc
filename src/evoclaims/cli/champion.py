"""`evoclaims champion`: a stored trial's champion, examined once more, drawn or exported."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from evoclaims.cli.project import open_project, open_store
from evoclaims.cli.run import describe
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.core.files import write_atomically
from evoclaims.networks import export, picture
from evoclaims.networks.graph import GraphNetwork
from evoclaims.trials import champions, devices
from evoclaims.trials.champions import Replay
from evoclaims.trials.records import printable
from evoclaims.trials.spec import Condition, TrialSpec


@dataclass(frozen=True)
class Subject:
    """A champion that is a genome, as the forms of export take it.

    Attributes:
        condition: its trial's.
        title: names the trial.
        parameters: the genome.
        network: what the genome describes.
    """

    condition: Condition
    title: str
    parameters: Any
    network: GraphNetwork


def main(options: argparse.Namespace) -> int:
    """Replay and, with --as, write; 1 when the replay is not what the record says."""
    if options.form is not None and options.form not in FORMS:
        raise UnknownNameError("form of a network", options.form, FORMS)
    if options.out is not None and options.form is None:
        raise UserError(f"--out names the file that --as writes; add --as {', '.join(FORMS)}.")
    _, reproduction = open_project()
    condition = reproduction.tier(options.tier).condition(options.method, options.on)
    spec, store = TrialSpec(condition, options.seed), open_store(options.storage)
    chosen = devices.choose(options.device)
    result = store.get(spec.id)
    if result is None:
        raise UserError(
            f"{printable(store.root)} holds no trial of {options.method} on {options.on} ({options.tier}) with seed "
            f"{options.seed}. `evoclaims run {options.method} --on {options.on} --tier {options.tier} --trials 1 "
            f"--first-seed {options.seed}` runs it."
        )
    parameters = champions.load(store, condition, result)
    title = f"{options.method} on {options.on} ({options.tier})"
    made = None
    if options.form is not None:
        network = champions.network_of(condition, parameters)
        if network is None:
            raise UserError(
                f"A champion of {options.method} is no genome but arrays of parameters, of which there is no graph to "
                f"write as {options.form}. Leave --as out to replay it; its arrays are in "
                f"{printable(store.champion_file(result))}."
            )
        made = FORMS[options.form](Subject(condition, f"{title}, seed {options.seed}", parameters, network))
    replay = champions.replay(condition, result, parameters, chosen)
    print(f"{title}\n  {describe(result)}")
    Console().print(_table(replay))
    print(_judgement(replay))
    if made is not None:
        default = f"{options.method}-{options.on}-{options.seed}.{options.form}"
        path = Path(default if options.out is None else options.out)
        _write(path, made)
        print(f"wrote {printable(path)}")
    return int(not replay.exact)


def _json(subject: Subject) -> bytes:
    """Return the genome as JSON."""
    return export.to_json(subject.parameters, subject.network).encode()


def _picture(file_format: picture.Format) -> Callable[[Subject], bytes]:
    """Return the function that draws a subject's network, and beside it the one that it draws on a substrate."""

    def drawn(subject: Subject) -> bytes:
        graph = export.to_networkx(subject.parameters, subject.network)
        drawing = champions.substrate_of(subject.condition, subject.parameters)
        if drawing is None:
            panel = picture.network_panel(graph, subject.network, "the network that evolved")
            return picture.draw([panel], subject.title, file_format)
        ends = ("x₁", "y₁", "x₂", "y₂"), ("q",)
        panels = [
            picture.network_panel(graph, subject.network, "the CPPN that evolved", *ends),
            picture.substrate_panel(*drawing, "the network that it draws"),
        ]
        return picture.draw(panels, subject.title, file_format)

    return drawn


FORMS: Mapping[str, Callable[[Subject], bytes]] = {"json": _json, "svg": _picture("svg"), "png": _picture("png")}


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


def _write(path: Path, data: bytes) -> None:
    """Write a file that the user has named."""
    if path.is_dir():
        raise UserError(f"{printable(path)} is a folder; name a file in it with --out.")
    try:
        write_atomically(path, data)
    except UserError as error:
        reason = getattr(error.__cause__, "strerror", None) or error.__cause__
        raise UserError(f"Cannot write {printable(path)}: {reason}. Name another file with --out.") from error
