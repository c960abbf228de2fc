"""The command line of `evoclaims`: its commands, their options and their help."""

from __future__ import annotations

import argparse
from importlib import metadata
from typing import Protocol

_WITHOUT_TIER = {"jobs", "verify", "merge", "tables"}
_TIERS = {
    "audit": ("full", "full (default: the paper's own sentences) or smoke"),
    **dict.fromkeys(("report", "accept", "compare", "export"), ("all", "smoke, full or all (default)")),
}
"""Defaults of --tier, and how it is explained, where they are not those of the other commands."""

_ON_DEVICES = {"plan", "run", "submit", "mutants", "power", "champion", "look", "across", "bisect", "watch"}
IN_PROCESSES = {"run", "mutants", "power", "watch"}
_PROCESSES = (
    "number of processes that run trials (1: this one, on all devices); auto: one per GPU, or without GPUs as many as "
    "keep the cores busy"
)


class _Add(Protocol):
    """Makes the parser of a command, which has the options that commands of its kind share."""

    def __call__(self, name: str, text: str, kept: str = ".evoclaims") -> argparse.ArgumentParser:
        """Return the parser; `text` is its help, and `kept` the folder of trials below the project's root."""


def parser() -> argparse.ArgumentParser:
    """Build the parser; its options have `refuse`, which ends the program with the usage of their command."""
    made = argparse.ArgumentParser(prog="evoclaims", description="Claims of a paper, judged by real trials.")
    made.add_argument("--version", action="version", version=f"evoclaims {metadata.version('evoclaims')}")
    commands = made.add_subparsers(dest="command", required=True, metavar="command")

    def add(name: str, text: str, kept: str = ".evoclaims") -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=text.partition("; ")[0], description=text)
        command.set_defaults(refuse=command.error)
        command.add_argument("--storage", metavar="DIR", help=f"folder of trials ({kept} in the project's root)")
        if name not in _WITHOUT_TIER:
            default, known = _TIERS.get(name, ("smoke", "smoke (default) or full"))
            command.add_argument("--tier", default=default, help=known)
        if name in _ON_DEVICES:
            command.add_argument("--device", default="auto", help="auto (default), cpu or gpu")
        if name in IN_PROCESSES:
            command.add_argument("--numprocesses", metavar="N", default="1", help=_PROCESSES)
        return command

    text = "write a project that runs; it has a method, a task and two claims, or, with --from, those of a paper"
    new = commands.add_parser("new", help=text.partition("; ")[0], description=text)
    new.set_defaults(storage=None, refuse=new.error)  # it reads no trials
    new.add_argument("folder", metavar="DIR", help="the folder to write: new or empty")
    what = new.add_mutually_exclusive_group()
    text = (
        "what it begins with: method (default), loop (your own training loop), gymnasium (one of its environments) or "
        "csv (a table of trials)"
    )
    what.add_argument("--with", dest="kind", metavar="KIND", default="method", help=text)
    what.add_argument("--from", dest="paper", metavar="PAPER", help="a paper, such as nisioti2025")

    for group in (_running, _reading, _keeping, _comparing, _exporting):
        group(add)
    return made


def _running(add: _Add) -> None:
    plan = add("plan", "show what a tier would run, what it costs here, and what its verdicts can show")
    plan.add_argument("--variant", metavar="NAME", default="", help="only what this variant of the protocol changes")
    plan.add_argument("--like", metavar="KIND", help="use times of trials made on this device, such as 'NVIDIA H200'")
    plan.add_argument("--measure", action="store_true", help="time a few steps of conditions never run here")

    text = (
        "run the missing trials of what claims need, or of named conditions, and judge nothing; with --variant run "
        "what it changes, and show which verdicts change"
    )
    run = add("run", text)
    run.add_argument("method", nargs="?", help="only this method")
    run.add_argument("--on", metavar="TASK", help="only this task")
    run.add_argument("--variant", metavar="NAME", default="", help="run what this variant changes, then judge by it")
    run.add_argument("--trials", type=int, metavar="N", help="trials per condition (default: the tier's)")
    run.add_argument(
        "--time-limit",
        metavar="TIME",
        help="time that a batch of trials may take, such as 90s, 30min, 24h or none (24h, or that of pyproject.toml)",
    )
    run.add_argument("--retry", action="store_true", help="continue trials that ran out of time under this limit")
    run.add_argument("--first-seed", type=int, default=0, metavar="SEED", help="seed of the first trial (0)")

    submit = add(
        "submit",
        "submit the missing batches of what a tier's claims need, or of named conditions, as jobs of SLURM or of this "
        "machine; a queued or running batch is left out",
    )
    submit.add_argument("method", nargs="?", help="only this method")
    submit.add_argument("--on", metavar="TASK", help="only this task")
    submit.add_argument("--variant", metavar="NAME", default="", help="only what this variant of the protocol changes")
    submit.add_argument("--cluster", default="slurm", help="slurm (default), or local: jobs on this machine")
    submit.add_argument("--partition", metavar="NAME", help="SLURM's partition")
    submit.add_argument("--gpus", type=int, metavar="N", help="GPUs of a job")
    submit.add_argument("--cpus", type=int, metavar="N", help="CPU cores of a job")
    submit.add_argument(
        "--time", metavar="TIME", help="time of a job; a longer batch continues in another job (2:00:00)"
    )
    submit.add_argument("--array", type=int, metavar="N", help="number of jobs that run at a time (256; local: 1)")
    submit.add_argument(
        "--slurm", metavar="KEY=VALUE", action="append", default=[], help="another option of sbatch: account=lab"
    )
    submit.add_argument("--dry-run", action="store_true", help="only print the jobs and their estimated hours")

    add("jobs", "show which submitted jobs are queued, running, done or failed, why, and where their logs are")

    mutants = add("mutants", "plant faults in methods and tasks, run them, and write which faults change which claims")
    mutants.add_argument("--mutant", metavar="NAME", help="only this fault, such as minimizes")
    mutants.add_argument("--of", metavar="TARGET", help="only faults of this method or this task")
    mutants.add_argument("--stored", action="store_true", help="run nothing; judge the stored trials")

    power = add(
        "power", "estimate from a pilot how often each claim ends as expected; exit status 1 if one is below 0.95"
    )
    power.add_argument("--only", metavar="CLAIMS", help="only these claims, by id or name, such as G1,S2[cma_es]")
    made = power.add_mutually_exclusive_group()
    made.add_argument(
        "--run",
        action="store_true",
        help="first run the trials of missing pilots, and write them; commit what it writes",
    )
    made.add_argument("--stored", action="store_true", help="first write missing pilots from trials that have run")
    power.add_argument(
        "--pilot",
        choices=("first", "second"),
        help="the pilot to make and to read (second if the tier has one, else first): bounds may be chosen from the "
        "first pilot, so power is better read from the second",
    )
    power.add_argument("--trials", type=int, default=50, metavar="N", help="trials per condition of a new pilot (50)")
    power.add_argument(
        "--first-seed",
        type=int,
        metavar="SEED",
        help="first seed of a new pilot, not one of the tier's or of the other pilot's (100; second: 150)",
    )
    power.add_argument("--draws", type=int, default=1000, metavar="N", help="draws from the pilot (1000)")


def _reading(add: _Add) -> None:
    status = add("status", "show the verdicts that the stored trials give, one line for each claim; run nothing")
    status.add_argument("--only", metavar="IDS", help="only these claims, such as G1,G7; G: all of G1, G2, …")
    status.add_argument(
        "--variant", metavar="NAME", default="", help="the verdicts that this variant of the protocol may change"
    )
    status.add_argument(
        "--why", action="store_true", help="also print why verdicts are accepted, inconclusive or not run"
    )
    status.add_argument("--as", dest="form", metavar="FORM", help="print csv, json or markdown instead of a table")

    add(
        "audit",
        "show what verdicts rest on: null agents, readings, duplicates, chance, power, and sentences without a claim; "
        "run nothing; exit status 1 when a supported verdict is vacuous or a claim names no line and date",
    )

    report = add("report", "write a web page about all claims from the trials at hand; run nothing")
    report.add_argument("--out", metavar="FOLDER", help="folder to write (report/)")

    champion = add("champion", "replay a stored trial's champion on every level")
    champion.add_argument("method", help="the method")
    champion.add_argument("--on", metavar="TASK", required=True, help="the task")
    champion.add_argument("--seed", type=int, default=0, help="the trial's seed (0)")

    look = add("look", "draw a robot's task, or show what a stored champion does in it")
    look.add_argument("task", help="the task")
    look.add_argument("--method", help="the method whose champion is shown; without it only the task is drawn")
    look.add_argument("--seed", type=int, default=0, help="the trial's seed (0)")
    look.add_argument(
        "--as",
        dest="form",
        metavar="FORM",
        help="path (default): a picture of the paths of all episodes; gif: an episode, animated",
    )
    look.add_argument(
        "--episode", type=int, default=0, metavar="N", help="number of the evaluation's episode, from 0 (0)"
    )
    look.add_argument(
        "--out",
        metavar="FILE",
        help="file to write (figures/TASK.svg, figures/METHOD-TASK-SEED-FORM.…); pictures are svg or png",
    )

    reproduce = add("reproduce", "redraw figures and tables of the paper from the trials at hand; run nothing")
    reproduce.add_argument("figure", help="its name, such as fig3; all: every figure and table")
    reproduce.add_argument("--out", metavar="DIR", help="folder for PNG, SVG and CSV (figures/TIER)")
    reproduce.add_argument(
        "--variant", metavar="NAME", default="", help="use the trials under this variant of the protocol"
    )


def _keeping(add: _Add) -> None:
    verify = add(
        "verify",
        "check every stored trial, champion and checkpoint; bad files are moved aside, and their trials run again; "
        "verdicts are not read, since `evoclaims status` judges the trials anew",
    )
    verify.add_argument("--dry-run", action="store_true", help="list bad files and leave them where they are")

    merge = add("merge", "copy trials and champions of other stores into one; existing files stay")
    merge.add_argument("stores", nargs="+", metavar="STORE", help="a folder of trials, such as another machine's")
    merge.add_argument("--dry-run", action="store_true", help="list what would be copied, and copy nothing")

    reference = add("reference", "write the stored trials of a tier as the committed reference trials")
    reference.add_argument("--variant", metavar="NAME", default="", help="only trials that this variant changes")
    reference.add_argument(
        "--unknown-revision", action="store_true", help="also trials that ran code of unknown git revision"
    )
    reference.add_argument(
        "--champions", action="store_true", help="also their champions, for evoclaims look and champion in a clone"
    )

    add("accept", "write the current verdicts into verdicts.toml, as accepted; exit status 1 if that changed the file")


def _comparing(add: _Add) -> None:
    compare = add(
        "compare",
        "compare the current verdicts with the accepted ones; or a store (OLD) with --storage; or two stores; run "
        "nothing",
    )
    compare.add_argument("places", nargs="*", metavar="OLD [NEW]", help="a folder of trials")
    compare.add_argument(
        "--fail", metavar="CHANGES", help="exit with 1 on these changes, such as 'supported->refuted,*->error'"
    )

    watch = add(
        "watch",
        "run new seeds, and report whether all nights together show that results differ from the committed trials; "
        "writes watch.toml, which you commit; exit status 1 on an alarm",
    )
    watch.add_argument("--trials", type=int, default=30, metavar="N", help="new trials per condition (30)")
    watch.add_argument(
        "--restart", action="store_true", help="begin a new series of nights, such as after an alarm was examined"
    )
    watch.add_argument("--as", dest="form", metavar="FORM", help="also write it: markdown, as the text of an issue")
    watch.add_argument("--out", metavar="FILE", help="file to write (report/watch.md)")

    across = add(
        "across",
        "judge claims with several releases of a package, files of constraints or Pythons; each has an environment, "
        "and is compared with the first; exit status 1 if a verdict changed, trials drifted, or an "
        "environment has no verdicts",
        ".evoclaims-releases",
    )
    across.add_argument(
        "--package",
        nargs="+",
        metavar=("NAME", "VERSION"),
        help="a package and versions to compare; other packages stay; installed and newest are versions too",
    )
    across.add_argument(
        "--constraints", nargs="+", metavar="FILE", help="an environment with the constraints of each file"
    )
    across.add_argument("--python", nargs="+", metavar="VERSION", help="an environment with each Python, such as 3.13")
    across.add_argument("--only", metavar="IDS", help="judge only these claims, such as G1,G7 or G6[neat-ppo]")
    across.add_argument("--as", dest="form", metavar="FORM", help="also write it: markdown, csv or json")
    across.add_argument("--out", metavar="FILE", help="file to write (report/across.FORM; .md for markdown)")

    bisect = add(
        "bisect",
        "find the release of a package in which a claim's verdict, or its trials, changed",
        ".evoclaims-releases",
    )
    bisect.add_argument("claim", help="the claim, such as G9, or one case of it, such as 'G1[n_parity]'")
    bisect.add_argument("--package", metavar="NAME", required=True, help="the package")
    bisect.add_argument("--good", metavar="VERSION", required=True, help="a release before the change")
    bisect.add_argument("--bad", metavar="VERSION", required=True, help="a later release, after the change")
    bisect.add_argument(
        "--releases", nargs="+", metavar="VERSION", help="the releases between them (default: as pip lists them)"
    )
    bisect.add_argument("--by", metavar="WHAT", help="verdict, drift or bits (default: the first of them that changed)")


def _exporting(add: _Add) -> None:
    """Add what writes trials for other programs and pages."""
    export = add("export", "write the trials at hand as a table")
    export.add_argument("--as", dest="form", metavar="FORM", default="json", help="json (default), csv or parquet")
    export.add_argument("--out", metavar="FILE", help="file to write (report/trials.FORM)")

    tables = add(
        "tables", "write the tables in Markdown files again, from the reference trials; exit status 1 if one changed"
    )
    tables.add_argument("files", nargs="+", metavar="FILE", help="such as README.md")
