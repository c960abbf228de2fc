"""Where a method meets a task: whatever has another shape or type than the other side takes is a sentence."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from probes import CURRICULUM
from trial_toys import Walker

from evoclaims.core.errors import UserError
from evoclaims.envs.base import Episode
from evoclaims.envs.gates.circuit import TruthTable
from evoclaims.envs.gates.parity import NParity
from evoclaims.methods.base import Policy, Progress
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.methods.random_search import RandomSearch
from evoclaims.trials.compatibility import CURVES, METRICS, traced_progress
from evoclaims.trials.program import Program
from evoclaims.trials.runner import run
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import Store

TASK = NParity(3)
BOTH = "The method 'walker' does not fit the task 'n_parity': "


BENDS: dict[str, Any] = {
    "shape ()": lambda answer: answer[0],
    "shape (7,)": lambda answer: jnp.repeat(answer, 7),
    "shape (1, 1)": lambda answer: answer[None],
    "type int32": lambda answer: answer.astype(jnp.int32),
    "type bool": lambda answer: answer > 0,
}


@dataclass(frozen=True)
class Answering(Walker):
    """A right network whose answer is bent into another shape or type; it is trained by its examination."""

    bend: str = ""

    def best(self, task: Any, state: Any) -> Policy:
        right = HandBuilt().best(task, jnp.int32(0))
        return Policy(right.parameters, lambda parameters, bits: BENDS[self.bend](right.function(parameters, bits)))


@pytest.mark.parametrize("what", BENDS)
def test_a_policy_whose_answer_is_bent_is_refused_with_both_names(what: str) -> None:
    with pytest.raises(UserError) as caught:
        traced_progress(Answering(bend=what), TASK)
    text = str(caught.value)
    assert text.startswith(f"{BOTH}an action has shape ")
    assert what in text
    assert text.endswith("and 'n_parity' takes shape (1,) and type float32.")


@pytest.mark.parametrize("task", [TASK, NParity(3, "sampled"), CURRICULUM], ids=["exhaustive", "sampled", "probe"])
@pytest.mark.parametrize("act", ["examine", "episode", "step"])
def test_a_bent_answer_is_refused_wherever_a_task_takes_one(task: Any, act: str) -> None:
    """So that candidates are checked while they are trained, and not the champion alone."""

    def take(key: Any) -> Any:
        level = jnp.zeros((), jnp.int32)
        if act == "step":
            return task.step(task.reset(key, level), jnp.zeros(()))
        return getattr(task, act)(lambda seen: jnp.zeros(()), key, level)

    with pytest.raises(UserError, match=r"An action has shape \(\) and type float32, and .* takes shape \(1,\)"):
        jax.eval_shape(take, jax.random.key(0))


@dataclass(frozen=True)
class Stepping(Walker):
    """A walker whose step gives something else than it should."""

    give: Any = None

    def step(self, key: Any, task: Any, level: Any, state: Any) -> Any:
        return self.give(*super().step(key, task, level, state))


STEPS: dict[str, Any] = {
    "a step of 'walker' reports a fitness of shape (1,) and type float32, not of shape () and type float32.": (
        lambda state, told: (state, replace(told, fitness=told.fitness[None]))
    ),
    "a step of 'walker' reports a success of shape () and type bool, not of shape () and type float32.": (
        lambda state, told: (state, replace(told, success=told.success > 0))
    ),
    "a step of 'walker' reports a mark `healthy` of shape () and type float32, not of shape () and type bool.": (
        lambda state, told: (state, replace(told, healthy=jnp.ones(())))
    ),
    "a step of 'walker' reports a metric 'first' of shape (4,) and type float32, not a real number of shape ().": (
        lambda state, told: (state, replace(told, metrics={"first": state}))
    ),
    "a step of 'walker' reports a metric 'z' of shape () and type complex64, not a real number of shape ().": (
        lambda state, told: (state, replace(told, metrics={"z": jnp.zeros((), jnp.complex64)}))
    ),
    "a step of 'walker' reports a tuple, and the engine takes a Progress.": (
        lambda state, told: (state, (told.fitness, told.success))
    ),
    "'walker' changes its state by a step: it is of shape (4,) and type float32 before and of shape (5,) and type "
    "float32 afterwards.": lambda state, told: (jnp.zeros(5), told),
    "'walker' changes its state by a step: it is of shape (4,) and type float32 before and of shape (4,) and type "
    "int32 afterwards.": lambda state, told: (jnp.zeros(4, jnp.int32), told),
    "a step of 'walker' reports a metric 'level', which the engine itself uses: give it another name.": (
        lambda state, told: (state, replace(told, metrics={"level": told.fitness}))
    ),
    "a step of 'walker' returns a Progress, not two values: state, Progress(...).": lambda state, told: told,
    "a step of 'walker' returns None (without a `return`?), not two values: state, Progress(...).": lambda *_: None,
    "a step of 'walker' reports None (without a `return`?) as its metrics, not a table such as {'gap': gap} ({} if it "
    "has none).": lambda state, told: (state, replace(told, metrics=None)),
    "a step of 'walker' reports a metric 1, whose name is not text: write it in quotes.": (
        lambda state, told: (state, replace(told, metrics={1: told.fitness}))
    ),
    "a step of 'walker' reports a metric 'x' of a list, which is not an array, not a real number of shape ().": (
        lambda state, told: (state, replace(told, metrics={"x": [told.fitness]}))
    ),
    "'walker' changes its state by a step: its structure is another one afterwards.": (
        lambda state, told: ((state, state), told)
    ),
}


@pytest.mark.parametrize("sentence", STEPS)
def test_a_step_that_gives_something_else_is_refused(sentence: str) -> None:
    with pytest.raises(UserError) as caught:
        traced_progress(Stepping(give=STEPS[sentence]), TASK)
    assert str(caught.value) == BOTH + sentence


@dataclass(frozen=True)
class Bent(NParity):
    """4-parity whose states are bent."""

    bend: Any = None
    only: str = ""

    def reset(self, key: Any, level: Any) -> Any:
        made = super().reset(key, level)
        return self.bend(made) if self.only == "reset" else made

    def step(self, state: Any, action: Any) -> Any:
        made = super().step(state, action)
        return self.bend(made) if self.only == "step" else made


STATES: dict[str, Any] = {
    "a tuple, not a TaskState.": lambda made: (made.observation, made.reward),
    "an observation of shape (1, 3) and type float32, not of shape (3,) and type float32.": (
        lambda made: replace(made, observation=made.observation[None])
    ),
    "a reward of shape () and type int32, not of shape () and type float32.": (
        lambda made: replace(made, reward=jnp.zeros((), jnp.int32))
    ),
    "a mark `terminated` of shape () and type float32, not of shape () and type bool.": (
        lambda made: replace(made, terminated=jnp.zeros(()))
    ),
    "an observation of a list, which is not an array, not of shape (3,) and type float32.": (
        lambda made: replace(made, observation=list(made.observation))
    ),
    "a mark `truncated` of shape (1,) and type bool, not of shape () and type bool.": (
        lambda made: replace(made, truncated=made.truncated[None])
    ),
}


@pytest.mark.parametrize("only", ["reset", "step"])
@pytest.mark.parametrize("what", STATES)
def test_a_task_that_gives_something_else_is_refused(what: str, only: str) -> None:
    with pytest.raises(UserError) as caught:
        traced_progress(Walker(), Bent(3, bend=STATES[what], only=only))
    assert str(caught.value) == f"{BOTH}the {only} of 'n_parity' gives {what}"
    task = Bent(3, bend=lambda made: replace(made, inner=replace(made.inner, level=made.reward)), only="step")
    with pytest.raises(UserError, match=r"'n_parity' changes its state by a step: \.level is of shape \(\) and type"):
        traced_progress(Walker(), task)


@pytest.mark.parametrize(
    ("size", "given"),
    [
        ("observation_size", "3"),
        ("action_size", 0),
        ("action_size", 3.0),
        ("horizon", 0),
        ("levels", 0),
        ("levels", 3.0),
    ],
)
def test_a_size_that_is_no_whole_number_is_refused(size: str, given: Any) -> None:
    odd = type("Odd", (NParity,), {size: given})
    with pytest.raises(UserError, match=f"{BOTH}'n_parity' has {size} = {given!r}, and it takes a whole number, at le"):
        traced_progress(Walker(), odd(3))


@pytest.mark.parametrize(
    ("cost", "budget"), [(0, Budget(environment_steps=8)), (2.5, Budget(generations=1)), (None, Budget(generations=1))]
)
def test_a_step_that_costs_no_whole_number_of_environment_steps_is_refused(
    cost: Any, budget: Budget, tmp_path: Any, cpus: list[Any]
) -> None:
    """Else its trials would be stored as having spent none, and a claim about steps would read that."""
    method = type("Costing", (Walker,), {"cost": lambda self, task: cost})()
    with pytest.raises(UserError, match=rf"A step of 'walker' on 'n_parity' costs {cost} environment steps"):
        run(Condition(method, TASK, "direct", budget), [0], Store(tmp_path), cpus)


def test_a_task_without_time_is_to_blame_where_a_step_costs_a_multiple_of_it() -> None:
    empty = type("Empty", (NParity,), {"name": "empty", "horizon": 0})
    with pytest.raises(UserError, match=r"'empty' has horizon = 0\. It must be at least 1 step\."):
        _ = Condition(RandomSearch(2), empty(3), "direct", Budget(generations=1)).cost


def test_the_engine_keeps_the_names_of_all_its_own_numbers(tmp_path: Any, cpus: list[Any]) -> None:
    (trial,) = run(Condition(Walker(), TASK, "direct", Budget(generations=1)), [0], Store(tmp_path), cpus)
    assert sorted(trial.metrics) == sorted(METRICS)
    assert set(trial.curves) - {"first"} == set(CURVES)


@dataclass(frozen=True)
class Examining(NParity):
    """3-parity whose examination gives something else."""

    give: Any = None

    def examine(self, policy: Any, key: Any, level: Any) -> Episode:
        episode: Episode = self.give(super().examine(policy, key, level))
        return episode


@pytest.mark.parametrize(
    ("give", "what"),
    [
        (lambda e: replace(e, fitness=e.fitness[None]), "a fitness of shape (2, 1) and type float32, not"),
        (lambda e: replace(e, success=e.success > 0), "a success of shape (2,) and type bool, not of shape (2,)"),
        (lambda e: replace(e, metrics={"x": jnp.zeros(3)}), "a metric 'x' of shape (2, 3) and type float32"),
        (lambda e: replace(e, metrics={"steps": e.fitness}), "a metric 'steps', which the engine itself uses"),
        (lambda e: (e.fitness, e.success), "a tuple, not an Episode"),
    ],
)
def test_an_examination_that_gives_something_else_is_refused(give: Any, what: str, cpus: list[Any]) -> None:
    program = Program(Condition(Walker(), Examining(3, give=give), "direct", Budget(generations=1)))
    number, mark = jax.ShapeDtypeStruct((), jnp.int32), jax.ShapeDtypeStruct((), bool)
    trial = jax.eval_shape(program.start, number, mark)
    with pytest.raises(UserError) as caught:
        jax.eval_shape(program.examine, trial)
    assert str(caught.value).startswith(f"{BOTH}the examination by 'n_parity' gives {what}")


YES = np.ones((4, 1), bool)
BITS = np.ones((4, 2), np.float32)


@pytest.mark.parametrize(
    ("table", "what"),
    [
        ((BITS.astype(np.int64), YES, YES, (4,)), "table has inputs of shape (4, 2) and type int64"),
        ((BITS[0], YES[:2], YES[:2], (1,)), "table has inputs of shape (2,) and type float32"),
        ((BITS, YES[:3], YES[:3], (3,)), "table has targets of shape (3, 1) and type bool"),
        ((BITS, YES.astype(np.float32), YES, (4,)), "table has targets of shape (4, 1) and type float32"),
        (
            (BITS, YES, np.ones((4, 2), bool), (4,)),
            "table has active outputs of shape (4, 2) and targets of shape (4, 1)",
        ),
        ((BITS, YES, YES, (2, 5)), "table has rows_at_level=(2, 5): write numbers above 0 that increase up to 4"),
        ((BITS, YES, YES, (3, 2)), "table has rows_at_level=(3, 2): write numbers above 0 that increase up to 4"),
        ((BITS, YES, YES, (2, 3)), "table has rows_at_level=(2, 3): write numbers above 0 that increase up to 4"),
        ((BITS, YES, YES, ()), "table has rows_at_level=(): write numbers above 0 that increase up to 4"),
        ((BITS, YES, np.array([[True], [False], [True], [True]]), (2, 4)), "table has a row without an active output"),
    ],
)
def test_a_truth_table_whose_parts_do_not_belong_together_is_refused(table: Any, what: str) -> None:
    @dataclass(frozen=True)
    class Odd(NParity):
        name: ClassVar[str] = "odd"

        @cached_property
        def table(self) -> TruthTable:
            return TruthTable(*table)

    with pytest.raises(UserError) as caught:
        traced_progress(Walker(), Odd(3))
    assert str(caught.value).startswith(f"The method 'walker' does not fit the task 'odd': a truth {what}")


def test_what_fits_is_told_as_it_is() -> None:
    counts = {"n": jnp.int32(3), "b": jnp.array(True)}
    progress = traced_progress(Stepping(give=lambda state, told: (state, replace(told, metrics=counts))), TASK)
    assert isinstance(progress, Progress)
    metrics = {"n": ((), "int32"), "b": ((), "bool")}
    assert jax.tree.map(lambda leaf: (leaf.shape, str(leaf.dtype)), progress) == Progress(
        fitness=((), "float32"), success=((), "float32"), healthy=((), "bool"), metrics=metrics
    )


def test_an_error_inside_a_method_or_task_has_a_note_with_both_names() -> None:
    @dataclass(frozen=True)
    class Broken(Walker):
        def init(self, key: Any, task: Any) -> Any:
            return jnp.zeros(3).reshape(8, 3)

    with pytest.raises(TypeError, match="cannot reshape") as caught:
        traced_progress(Broken(), TASK)
    assert "The method 'walker' was tried on the task 'n_parity'." in caught.value.__notes__


@dataclass(frozen=True)
class Deaf(NParity):
    """Asks the same at every level."""

    name: ClassVar[str] = "deaf"

    def reset(self, key: Any, level: Any) -> Any:
        return super().reset(key, jnp.int32(0))


def test_a_task_whose_reset_does_not_read_the_level_is_refused_if_it_has_several() -> None:
    with pytest.raises(UserError, match="'deaf' has 2 levels, and its reset does the same on all of them"):
        traced_progress(Walker(), Deaf(3))


@dataclass(frozen=True)
class Misspelled(Walker):
    """Declares a package that there is none of."""

    packages: ClassVar[tuple[str, ...]] = ("optacs",)


def test_a_package_that_is_not_installed_is_named_before_anything_runs(tmp_path: Any, cpus: list[Any]) -> None:
    with pytest.raises(UserError, match="The packages of 'walker' name optacs, not installed here. Check the spelling"):
        run(Condition(Misspelled(), TASK, "direct", Budget(generations=1)), [0], Store(tmp_path), cpus)


@dataclass(frozen=True)
class Rounded(NParity):
    """Its examination's success is a mean of ones, rounded."""

    def examine(self, policy: Any, key: Any, level: Any) -> Any:
        return replace(super().examine(policy, key, level), success=jnp.float32(0.99999994))


def test_a_success_that_is_1_but_for_rounding_is_a_sentence(tmp_path: Any, cpus: list[Any]) -> None:
    with pytest.raises(UserError, match=r"of 0\.9999999\d+, which is 1 except for rounding.*evoclaims\.envs\.averaged"):
        run(Condition(Walker(), Rounded(3), "direct", Budget(generations=1)), [0], Store(tmp_path), cpus)


@pytest.mark.parametrize(
    ("policy", "what"),
    [
        (Policy(jnp.zeros(1), None), "a Policy with None as its function, which cannot be called."),  # type: ignore[arg-type]
        (Policy(1.5, lambda _, bits: bits[:1]), "a Policy with 1.5 among its parameters, which are arrays: jnp."),
        (None, "None (without a `return`?), not Policy(parameters, function)."),
        (jnp.zeros(1), "an array, not Policy(parameters, function)."),
        ((jnp.zeros(1), jnp.tanh), "a tuple, not Policy(parameters, function)."),
    ],
    ids=["function", "float", "None", "array", "tuple"],
)
def test_a_policy_without_function_or_arrays_is_refused(policy: Any, what: str) -> None:
    method = type("Odd", (Walker,), {"best": lambda self, task, state: policy})()
    with pytest.raises(UserError) as caught:
        traced_progress(method, TASK)
    assert str(caught.value).startswith(f"{BOTH}'best' of 'walker' returns {what}")


@pytest.mark.parametrize("action", [None, "yes", [[1.0], [1.0, 2.0]]])
def test_an_action_that_is_no_array_is_refused_with_both_names(action: Any) -> None:
    method = type("Odd", (Walker,), {"best": lambda self, task, state: Policy(state, lambda p, bits: action)})()
    with pytest.raises(
        UserError, match=BOTH + r"an action is .*, which is not an array, and 'n_parity' takes shape \(1,\)"
    ):
        traced_progress(method, TASK)


@dataclass(frozen=True)
class Playing(NParity):
    """3-parity whose episode gives something else."""

    give: Any = None

    def episode(self, policy: Any, key: Any, level: Any) -> Any:
        return self.give(super().episode(policy, key, level))


@pytest.mark.parametrize(
    ("give", "what"),
    [
        (lambda e: None, "None (without a `return`?), not an Episode."),
        (lambda e: e.fitness, "an array, not an Episode."),
        (lambda e: (e.fitness, e.success), "a tuple, not an Episode."),
        (lambda e: replace(e, success=[e.success]), "a success of a list, which is not an array, not of shape () and"),
    ],
    ids=["None", "array", "tuple", "list"],
)
def test_an_episode_that_is_none_is_named_and_not_what_a_method_fails_at(give: Any, what: str) -> None:
    with pytest.raises(UserError) as caught:
        traced_progress(RandomSearch(2), Playing(3, give=give))
    assert str(caught.value).startswith(
        f"{BOTH.replace('walker', 'random_search')}an episode of 'n_parity' gives {what}"
    )


def test_an_error_of_the_methods_own_is_not_laid_at_the_episodes_door() -> None:
    method = type("Odd", (Walker,), {"step": lambda *_: TASK.nothing})()
    with pytest.raises(AttributeError, match="nothing"):
        traced_progress(method, TASK)
