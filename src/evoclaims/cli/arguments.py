"""The command line of `evoclaims`: its commands, their options and their help."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from importlib import metadata
from typing import Any

_WITHOUT_TIER = {"jobs", "verify", "merge", "tables"}
_TIERS = {
    "audit": ("full", "full (default: the paper's own sentences) or smoke"),
    **dict.fromkeys(("report", "accept", "compare", "export"), ("all", "smoke, full or all (default)")),
}
"""Defaults of --tier, and how it is explained, where they are not those of the other commands."""

_ON_DEVICES = {"plan", "run", "submit", "mutants", "power", "champion", "look", "across", "bisect", "watch"}
IN_PROCESSES = {"run", "mutants", "power", "watch"}
_PROCESSES = (
    "number of processes that run trials (1: this one, on all devices); auto: one per GPU (two where NVIDIA's MPS "
    "runs), or without GPUs as many as keep the cores busy"
)


_Add = Callable[[str, str], argparse.ArgumentParser]
"""Makes the parser of a command by its name and help; it has the options that commands of its kind share."""


def _option(command: argparse._ActionsContainer, written: str, text: str, **more: Any) -> None:
    """Add an option as it is written, such as "--tier TIER"; one without a value is True where it is given."""
    name, _, value = written.partition(" ")
    more |= {"metavar": value} if value else {"action": "store_true"}
    command.add_argument(name, help=text, **more)


def parser() -> argparse.ArgumentParser:
    """Build the parser; its options have `refuse`, which ends the program with the usage of their command."""
    made = argparse.ArgumentParser(prog="evoclaims", description="Claims of a paper, judged by real trials.")
    made.add_argument("--version", action="version", version=f"evoclaims {metadata.version('evoclaims')}")
    commands = made.add_subparsers(dest="command", required=True, metavar="command")

    def add(name: str, text: str) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=text.partition("; ")[0], description=text)
        command.set_defaults(refuse=command.error)
        kept = ".evoclaims-releases" if name in ("across", "bisect") else ".evoclaims"
        _option(command, "--storage DIR", f"folder of trials ({kept} in the project's root)")
        if name not in _WITHOUT_TIER:
            default, known = _TIERS.get(name, ("smoke", "smoke (default) or full"))
            _option(command, "--tier TIER", known, default=default)
        if name in _ON_DEVICES:
            _option(command, "--device DEVICE", "auto (default), cpu or gpu", default="auto")
        if name in IN_PROCESSES:
            _option(command, "--numprocesses N", _PROCESSES, default="1")
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
    _option(what, "--with KIND", text, dest="kind", default="method")
    _option(what, "--from PAPER", "a paper, such as nisioti2025", dest="paper")

    for group in (_running, _reading, _keeping, _comparing):
        group(add)
    return made


def _running(add: _Add) -> None:
    plan = add("plan", "show what a tier would run, what it costs here, and what its verdicts can show")
    _option(plan, "--variant NAME", "only what this variant of the protocol changes", default="")
    _option(plan, "--like KIND", "use times of trials made on this device, such as 'NVIDIA H200'")
    _option(plan, "--measure", "time a few steps of conditions never run here")

    text = (
        "run the missing trials of what claims need, or of named conditions, and judge nothing; with --variant run "
        "what it changes, and show which verdicts change"
    )
    run = add("run", text)
    run.add_argument("method", nargs="?", help="only this method")
    _option(run, "--on TASK", "only this task")
    _option(run, "--variant NAME", "run what this variant changes, then judge by it", default="")
    _option(run, "--trials N", "trials per condition (default: the tier's)", type=int)
    _option(
        run,
        "--time-limit TIME",
        "time that a batch of trials may take, such as 90s, 30min, 24h or none (24h, or that of pyproject.toml)",
    )
    _option(run, "--retry", "continue trials that ran out of time under this limit")
    _option(run, "--first-seed SEED", "seed of the first trial (the tier's)", type=int)

    submit = add(
        "submit",
        "submit the missing batches of what a tier's claims need, or of named conditions, as jobs of SLURM or of this "
        "machine; a queued or running batch is left out",
    )
    submit.add_argument("method", nargs="?", help="only this method")
    _option(submit, "--on TASK", "only this task")
    _option(submit, "--variant NAME", "only what this variant of the protocol changes", default="")
    _option(submit, "--trials N", "trials per condition (default: the tier's; a third look takes 30)", type=int)
    _option(submit, "--cluster CLUSTER", "slurm (default), or local: jobs on this machine", default="slurm")
    _option(submit, "--partition NAME", "SLURM's partition")
    _option(submit, "--gpus N", "GPUs of a job", type=int)
    _option(submit, "--cpus N", "CPU cores of a job", type=int)
    _option(submit, "--time TIME", "time of a job; a longer batch continues in another job (2:00:00)")
    _option(submit, "--array N", "number of jobs that run at a time (256; local: 1)", type=int)
    submit.add_argument(
        "--slurm", metavar="KEY=VALUE", action="append", default=[], help="another option of sbatch: account=lab"
    )
    _option(submit, "--dry-run", "only print the jobs and their estimated hours")

    add("jobs", "show which submitted jobs are queued, running, done or failed, why, and where their logs are")

    mutants = add("mutants", "plant faults in methods and tasks, run them, and write which faults change which claims")
    _option(mutants, "--mutant NAME", "only this fault, such as minimizes")
    _option(mutants, "--of TARGET", "only faults of this method or this task")
    _option(mutants, "--stored", "run nothing; judge the stored trials")

    power = add(
        "power", "estimate from a pilot how often each claim ends as expected; exit status 1 if one is below 0.95"
    )
    _option(power, "--only CLAIMS", "only these claims, by id or name, such as G1,S2[cma_es]")
    made = power.add_mutually_exclusive_group()
    _option(made, "--run", "first run the trials of missing pilots, and write them; commit what it writes")
    _option(made, "--stored", "first write missing pilots from trials that have run")
    power.add_argument(
        "--pilot",
        choices=("first", "second"),
        help="the pilot to make and to read (second if the tier has one, else first): bounds may be chosen from the "
        "first pilot, so power is better read from the second",
    )
    _option(power, "--trials N", "trials per condition of a new pilot (50)", type=int, default=50)
    _option(
        power,
        "--first-seed SEED",
        "first seed of a new pilot, not one of the tier's or of the other pilot's (100; second: 150)",
        type=int,
    )
    _option(power, "--draws N", "draws from the pilot (1000)", type=int, default=1000)


def _reading(add: _Add) -> None:
    status = add("status", "show the verdicts that the stored trials give, one line for each claim; run nothing")
    _option(status, "--only IDS", "only these claims, such as G1,G7; G: all of G1, G2, …")
    _option(status, "--variant NAME", "the verdicts that this variant of the protocol may change", default="")
    _option(status, "--why", "also print why verdicts are accepted, inconclusive or not run")
    _option(status, "--as FORM", "print csv, json or markdown instead of a table", dest="form")

    add(
        "audit",
        "show what verdicts rest on: null agents, readings, duplicates, chance, power, and sentences without a claim; "
        "run nothing; exit status 1 when a supported verdict is vacuous or a claim names no line and date",
    )

    report = add("report", "write a web page about all claims from the trials at hand; run nothing")
    _option(report, "--out FOLDER", "folder to write (report/)")

    champion = add("champion", "replay a stored trial's champion on every level")
    champion.add_argument("method", help="the method")
    _option(champion, "--on TASK", "the task", required=True)
    _option(champion, "--seed SEED", "the trial's seed (0)", type=int, default=0)

    look = add("look", "draw a robot's task, or show what a stored champion does in it")
    look.add_argument("task", help="the task")
    _option(look, "--method METHOD", "the method whose champion is shown; without it only the task is drawn")
    _option(look, "--seed SEED", "the trial's seed (0)", type=int)
    _option(
        look,
        "--as FORM",
        "path (default): a picture of the paths of all episodes; gif: an episode, animated",
        dest="form",
    )
    _option(look, "--episode N", "number of the evaluation's episode, from 0 (0)", type=int)
    _option(
        look, "--out FILE", "file to write (figures/TASK.svg, figures/METHOD-TASK-SEED-FORM.…); pictures are svg or png"
    )

    reproduce = add("reproduce", "redraw figures and tables of the paper from the trials at hand; run nothing")
    reproduce.add_argument("figure", help="its name, such as fig3; all: every figure and table")
    _option(reproduce, "--out DIR", "folder for PNG, SVG and CSV (figures/TIER)")
    _option(reproduce, "--variant NAME", "use the trials under this variant of the protocol", default="")


def _keeping(add: _Add) -> None:
    verify = add(
        "verify",
        "check every stored trial, champion and checkpoint; bad files are moved aside, and their trials run again; "
        "verdicts are not read, since `evoclaims status` judges the trials anew",
    )
    _option(verify, "--dry-run", "list bad files and leave them where they are")

    merge = add("merge", "copy trials and champions of other stores into one; existing files stay")
    merge.add_argument("stores", nargs="+", metavar="STORE", help="a folder of trials, such as another machine's")
    _option(merge, "--dry-run", "list what would be copied, and copy nothing")

    reference = add("reference", "write the stored trials of a tier as the committed reference trials")
    _option(reference, "--variant NAME", "only trials that this variant changes", default="")
    _option(reference, "--unknown-revision", "also trials that ran code of unknown git revision")
    _option(reference, "--champions", "also their champions, for evoclaims look and champion in a clone")

    add("accept", "write the current verdicts into verdicts.toml, as accepted; exit status 1 if that changed the file")


def _comparing(add: _Add) -> None:
    compare = add(
        "compare",
        "compare the current verdicts with the accepted ones; or a store (OLD) with --storage; or two stores; run "
        "nothing",
    )
    compare.add_argument("places", nargs="*", metavar="OLD [NEW]", help="a folder of trials")
    _option(compare, "--fail CHANGES", "exit with 1 on these changes, such as 'supported->refuted,*->error'")

    watch = add(
        "watch",
        "run new seeds, and report whether all nights together show that results differ from the committed trials; "
        "writes watch.toml, which you commit; exit status 1 on an alarm",
    )
    _option(watch, "--trials N", "new trials per condition (30)", type=int, default=30)
    _option(watch, "--restart", "begin a new series of nights, such as after an alarm was examined")
    _option(watch, "--as FORM", "also write it: markdown, as the text of an issue", dest="form")
    _option(watch, "--out FILE", "file to write (report/watch.md)")

    across = add(
        "across",
        "judge claims with several releases of a package, files of constraints or Pythons; each has an environment, "
        "and is compared with the first; exit status 1 if a verdict changed, trials drifted, or an "
        "environment has no verdicts",
    )
    across.add_argument(
        "--package",
        nargs="+",
        metavar=("NAME", "VERSION"),
        help="a package and versions to compare; other packages stay; installed and newest are versions too",
    )
    _option(across, "--constraints FILE", "an environment with the constraints of each file", nargs="+")
    _option(across, "--python VERSION", "an environment with each Python, such as 3.13", nargs="+")
    _option(across, "--only IDS", "judge only these claims, such as G1,G7 or G6[neat-ppo]")
    _option(across, "--as FORM", "also write it: markdown, csv or json", dest="form")
    _option(across, "--out FILE", "file to write (report/across.FORM; .md for markdown)")

    bisect = add("bisect", "find the release of a package in which a claim's verdict, or its trials, changed")
    bisect.add_argument("claim", help="the claim, such as G9, or one case of it, such as 'G1[n_parity]'")
    _option(bisect, "--package NAME", "the package", required=True)
    _option(bisect, "--good VERSION", "a release before the change", required=True)
    _option(bisect, "--bad VERSION", "a later release, after the change", required=True)
    _option(bisect, "--releases VERSION", "the releases between them (default: as pip lists them)", nargs="+")
    _option(bisect, "--by WHAT", "verdict, drift or bits (default: the first of them that changed)")

    export = add("export", "write the trials at hand as a table")
    _option(export, "--as FORM", "json (default), csv or parquet", dest="form", default="json")
    _option(export, "--out FILE", "file to write (report/trials.FORM)")

    tables = add(
        "tables", "write the tables in Markdown files again, from the reference trials; exit status 1 if one changed"
    )
    tables.add_argument("files", nargs="+", metavar="FILE", help="such as README.md")
