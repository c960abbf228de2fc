"""Each option of jax either changes no trial, or is named before the first one."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax
import pytest

from evoclaims.core.errors import UserError
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.trials import devices, jax_options
from evoclaims.trials.jax_options import DEFAULTS, FREE, refuse_changed
from evoclaims.trials.loop_process import examined
from evoclaims.trials.runner import run
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import Store


@pytest.fixture(scope="module", autouse=True)
def compiled_once() -> None:
    """Nothing is kept here from other tests: options may change what is compiled."""


def _others(name: str) -> list[Any]:
    """Return the values that an option has not, of a boolean or an enumeration."""
    kind, arguments, settings = jax.config.meta[name]
    value = jax.config.values[name]
    if kind is bool:
        return [not value]
    if kind == "enum":
        return [one for one in settings.get("enum_values") or arguments[0] if one != value]
    if kind == "enum_class":
        return [one for one in settings.get("enum_class") or arguments[0] if one is not value]
    return []


OPTIONS = {name: values for name in sorted(jax.config.values) if (values := _others(name))}


@pytest.fixture(autouse=True)
def as_before() -> Iterator[None]:
    """Restore every option."""
    was = {name: jax.config.values[name] for name in OPTIONS}
    level = logging.getLogger("jax").level
    yield
    for name, value in was.items():
        if jax.config.values[name] != value:
            jax.config.update(name, value)
    logging.getLogger("jax").setLevel(level)


def test_registry_of_jax_is_seen() -> None:
    assert len(OPTIONS) > 70
    assert {"jax_enable_x64", "jax_disable_jit", "jax_default_prng_impl", "jax_transfer_guard"} <= OPTIONS.keys()


@pytest.mark.parametrize("name", OPTIONS)
def test_option_with_another_value_is_free_or_refused(name: str) -> None:
    for value in OPTIONS[name]:
        jax.config.update(name, value)
        if name in FREE:
            refuse_changed()
        else:
            with pytest.raises(
                UserError, match=rf"^These settings of jax change .*\b{name} is .* \(default: .*Remove jax\.config"
            ):
                refuse_changed()


def test_defaults_are_those_of_the_installed_release() -> None:
    refuse_changed()
    assert FREE.isdisjoint(DEFAULTS)
    release = jax_options._of_release()
    assert {name: value for name, value in DEFAULTS.items() if name in release} == {
        name: value for name, value in release.items() if name in DEFAULTS
    }
    unknown = release.keys() - FREE - DEFAULTS.keys()
    assert all(release[name] in jax_options._NEUTRAL for name in unknown), unknown  # else each process asks for it


@pytest.mark.filterwarnings("ignore")
def test_free_options_leave_a_trial_as_it_is(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """All at once; jax logs much more then."""
    condition = Condition(HandBuilt(), NParity(2), "curriculum", Budget(generations=1, reports=1))
    before = run(condition, [0], Store(tmp_path / "before"), devices.choose("cpu"))
    for name in OPTIONS.keys() & FREE:
        jax.config.update(name, OPTIONS[name][-1])
    jax.clear_caches()
    after = run(condition, [0], Store(tmp_path / "after"), devices.choose("cpu"))
    assert [trial.digest for trial in after] == [trial.digest for trial in before]


def test_option_of_a_later_release_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    holders = jax.config._value_holders
    monkeypatch.setitem(holders, "jax_of_tomorrow", SimpleNamespace(value=False))
    refuse_changed()
    monkeypatch.setitem(holders, "jax_of_tomorrow", SimpleNamespace(value=True))
    with pytest.raises(UserError, match=re.escape("jax_of_tomorrow is True (default: another)")):
        refuse_changed()


def test_option_that_another_release_has_by_default_is_no_change(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jax_options, "_of_release", lambda: {"jax_scan3": "True"})
    jax.config.update("jax_scan3", True)
    refuse_changed()


def test_context_manager_is_seen_where_devices_are_chosen() -> None:
    with jax.enable_x64(True), pytest.raises(UserError, match="jax_enable_x64 is True"):
        devices.choose("cpu")
    assert devices.choose("cpu")


def test_training_function_that_leaves_an_option_behind_is_told_before_its_examination() -> None:
    jax.config.update("jax_enable_x64", True)
    with pytest.raises(UserError, match="jax_enable_x64 is True"):
        examined(NParity(2), lambda observation: observation, 0)


def test_variables_are_named_before_anything_runs(project: Any, sentence: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    project.write(a="supported")
    variables = ("JAX_DISABLE_JIT", "JAX_ENABLE_X64", "JAX_NO_EXECUTION")
    for variable in variables:
        monkeypatch.setenv(variable, "1")
    result = project.run_apart()
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    sentence(result, "These settings of jax change or forbid trials: ")
    shown = " ".join("\n".join([*result.outlines, *result.errlines]).split())
    pattern = r"forbid trials: (.*?)\. Trials are defined with jax's defaults\. Unset (.*?)\."
    (told,) = re.findall(pattern, shown)
    assert sorted(told[0].split(", ")) == [f"{variable.lower()} is True (default: False)" for variable in variables]
    assert sorted(told[1].split(" and ")) == [*variables]
