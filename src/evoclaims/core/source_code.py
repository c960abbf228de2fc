"""The code of a project's own methods and tasks as hashes, which tell that it was edited after trials had run."""

from __future__ import annotations

import ast
import dataclasses
import hashlib
import inspect
import sys
import sysconfig
from collections.abc import Iterator, Mapping
from functools import cache, partial, reduce
from importlib.util import find_spec, resolve_name
from pathlib import Path
from textwrap import dedent
from types import ModuleType
from typing import Any, Final

import numpy as np

from evoclaims.core.canonical import as_plain, content_hash, is_own
from evoclaims.core.errors import PACKAGE_FOLDERS
from evoclaims.core.files import read_file
from evoclaims.core.foreign import Later

CODE: Final = "code_hashes"
"""Key under which a trial's provenance has these hashes."""

DIGITS: Final = 16
"""Of a hash that are kept."""

REGISTRATION: Final = "the registration of "

PARTS: Final = ":"
"""Between the parts of a hash: of the code; of arrays, sets and dataclasses that it names; of other objects."""

_IN_THE_ID: Final = ("name", "revision", "packages")
"""Class variables of a method or task that its trials' ids or versions hold."""

_WITHOUT_CODE: Final = frozenset((type(None), bool, int, float, str))
"""Types of most fields."""

_SAYS_NOTHING: Final = ("ctx", "kind", "type_comment")
"""Fields of a syntax tree that its place, or nothing that computes, decides."""


def code_of(*components: Any) -> dict[str, str]:
    """Return hashes of the code of components and of the parts in their fields, by "module.Class".

    Classes of this package and of installed ones are left out: trials record their versions. A hash is of the class,
    its bases, and the functions, classes, constants, arrays, sets and dataclasses that these name, directly or through
    each other; of other objects that they name, the statements of the module that make them, and what these name.
    Comments, docstrings, layout and what ids hold anyhow (values of fields, `revision`) do not count. What is reached
    in other ways, such as by a name that is made of words, is not seen. A module that only other processes import is
    known by its text alone.
    """
    code = {one for component in components for one in _code(component)}
    parts = frozenset(one for one in code - {*map(_at, components)} if inspect.isclass(one))
    found: dict[str, str] = dict(one for one in code if isinstance(one, tuple))
    own = (one for one in code if not isinstance(one, tuple) and _is_the_projects(one))
    found |= {f"{one.__module__}.{one.__qualname__}": _hash(one, parts) for one in own}
    return {name: found[name] for name in sorted(found)}


def is_edited(then: str | None, now: str) -> bool:
    """Whether a recorded hash is of other code than the present one; older records have fewer parts."""
    return then is None or not (now + PARTS).startswith(then + PARTS)


def _code(component: Any) -> Iterator[Any]:
    """Yield the classes of a component and of the parts in its fields, what is at its place, and its registration."""
    if type(component) in _WITHOUT_CODE:
        return
    if isinstance(component, Mapping):
        component = tuple(component.values())
    if isinstance(component, tuple | list):
        for part in component:
            if type(part) not in _WITHOUT_CODE:  # of a long row of numbers nothing else is asked
                yield from _code(part)
    elif dataclasses.is_dataclass(component) and not isinstance(component, type):
        kind = type(component)  # of a planted fault it is made elsewhere, from the project's class
        yield from (kind,) if _is_the_projects(kind) else kind.__mro__
        if found := _at(component):
            yield found
        if registered := _contents(getattr(component, "registered", None)):
            yield REGISTRATION + getattr(component, "name", ""), content_hash(registered)[:DIGITS]
        for field in dataclasses.fields(component):
            yield from _code(getattr(component, field.name))


_TEXTS: Final[dict[str, tuple[str, str] | None]] = {}
"""Modules of the project that may be imported later, each with one hash of its text in a process; None for others."""


def _at(component: Any) -> Any:
    """Return the function or class at a component's place, the class that has a method, or a module and its hash."""
    module, _, name = str(getattr(component, "place", "")).partition(":")
    if not name:
        return None
    words = name.split(".")[:-1] or [name]  # of a method the class, with what it calls
    try:
        if module in sys.modules and module not in _TEXTS:
            found = reduce(getattr, words, sys.modules[module])
            return found if inspect.isfunction(found) or inspect.isclass(found) else None
        if module not in _TEXTS:  # to look for a module imports its package, which of installed ones may take long
            foreign = _is_installed(_file_of(module.partition(".")[0]))
            tree = None if foreign else _as_lists(_without_words(ast.parse(read_file(_file_of(module)))))
            _TEXTS[module] = tree and (module, content_hash(tree)[:DIGITS])
        return _TEXTS[module]
    except Exception:  # there is no such thing, an error where it is used; or its package is broken
        return None


def _file_of(module: str) -> Path:
    return Path(getattr(find_spec(module), "origin", None) or "")


@cache
def _of_python() -> tuple[str, ...]:
    """Return the folders of Python and of what is installed in its environment."""
    return tuple(map(sysconfig.get_path, ("stdlib", "platstdlib", "purelib", "platlib")))


@cache
def _holds_packages(folder: str) -> bool:
    """Whether packages are installed in a folder of `sys.path`, as by `pip install --target`."""
    return any(Path(folder).glob("*.dist-info"))


def _is_installed(file: Path) -> bool:
    """Whether a file is Python's, or an installed package's, wherever that is: also another user's, or a system's."""
    if not PACKAGE_FOLDERS.isdisjoint(file.parts) or any(map(file.is_relative_to, _of_python())):
        return True
    roots = [folder for folder in sys.path if folder and file.is_relative_to(folder)]
    return bool(roots) and _holds_packages(max(roots, key=len))


@cache
def _is_the_projects(one: Any) -> bool:
    """Whether a class, function or module is of the user's own files: not this package's, Python's, or installed."""
    if is_own(one):
        return False
    try:
        return not _is_installed(Path(inspect.getfile(one)))
    except (TypeError, OSError):  # built in
        return False


@cache
def _hash(code: Any, parts: frozenset[type]) -> str:
    """Return a hash of the code of a class or function and of all of the project's that it names.

    Fields of `parts`, the classes of the components with it, are in ids.
    """
    codes, arrays, objects = dict[str, Any](), dict[str, Any](), dict[str, Any]()
    held, later = [code], list[Any]()
    found, contained = codes, arrays
    while held or later:
        if not held:  # what is reached through objects alone is a part that older records lack
            held, later = later, []
            found = contained = objects
        one = held.pop()
        one = one if isinstance(one, _Variable) else _bare(one)
        name, tree, module = _read(one)
        # Functions may name each other in circles: each is hashed once.
        if tree is None or name in codes or name in objects:
            continue
        # The syntax tree and not the text, so that a comment or a new layout does not look like an edit.
        found[name] = _as_lists(tree)
        if not (dataclasses.is_dataclass(one) and any(one in part.__mro__ for part in parts)):
            objects |= {f"{name}.{word}": default for word, default in _defaults(one).items()}
        held += one.__bases__ if inspect.isclass(one) else ()
        for word, value, variable in _named(tree, module):
            if _is_constant(value):
                found[f"{name}: {word}"] = repr(value)
            elif (contents := _contents(value)) is not None:
                contained[f"{name}: {word}"] = contents
                later += _code(value)
            else:
                held.append(value)
                later.append(variable)
        for node, alias in _imports(ast.walk(tree)):  # also within a function
            if source := _imported_from(node, module):
                later += [_Variable(source, alias.name), getattr(source, alias.name, None)]
    return PARTS.join(content_hash(part)[:DIGITS] if part else "" for part in (codes, arrays, objects)).rstrip(PARTS)


@dataclasses.dataclass(frozen=True)
class _Variable:
    """A name in a module."""

    module: ModuleType
    word: str


def _read(one: Any) -> tuple[str, ast.Module | None, ModuleType]:
    """Return the name, the syntax tree and the module of a class, function or variable; no tree of what has none."""
    if isinstance(one, _Variable):
        origin = _origin(one)
        return f"{origin.module.__name__}: {origin.word}", _making(origin), origin.module
    module = sys.modules.get(getattr(one, "__module__", None) or "")
    kind_of_code: bool = inspect.isclass(one) or inspect.isfunction(one)
    if module is None or not kind_of_code or not _is_the_projects(one):
        return "", None, ast
    return f"{one.__module__}.{one.__qualname__}", _tree(one), module


def _origin(variable: _Variable) -> _Variable:
    """Return the variable of a project's module that one is imported from, or itself."""
    for node, alias in _bindings(variable.module)[1]:
        word = variable.word if alias.name == "*" else alias.name
        source = _imported_from(node, variable.module)
        if source and variable.word == (alias.asname or word) and hasattr(source, word):
            return _origin(_Variable(source, word))
    return variable


def _making(variable: _Variable) -> ast.Module | None:
    """Return the statements that make a variable, or what it is another name of; None if there are neither."""
    statements, imports = _bindings(variable.module)
    made = [*statements.get(variable.word, ())]
    for _, alias in imports:
        if variable.word == alias.asname:
            value = getattr(variable.module, variable.word, None)
            # `from jax import numpy as np` is `import jax.numpy as np`.
            made.append(ast.Expr(ast.Constant(value.__name__ if isinstance(value, ModuleType) else alias.name)))
    return ast.Module(made, []) if made else None


@cache
def _bindings(module: ModuleType) -> tuple[dict[str, list[ast.stmt]], list[tuple[ast.AST, ast.alias]]]:
    """Return the statements that give each variable of a project's module a value, and what the module imports."""
    text = _parsed(module) if _is_the_projects(module) else ast.Module([], [])
    made: dict[str, list[ast.stmt]] = {}
    for statement in text.body:
        for word in dict.fromkeys(map(_changed, _outside(statement))):
            if word is not None:
                made.setdefault(word, []).append(statement)
    return made, list(_imports(_outside(text)))


def _imports(nodes: Iterator[ast.AST]) -> Iterator[tuple[ast.AST, ast.alias]]:
    """Yield what statements import."""
    for node in nodes:
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield from ((node, alias) for alias in node.names)


def _outside(node: ast.AST) -> Iterator[ast.AST]:
    """Yield what is outside of functions and classes."""
    if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef | ast.Lambda):
        yield node
        for part in ast.iter_child_nodes(node):
            yield from _outside(part)


def _changed(node: Any) -> str | None:
    """Return the name that a node gives a value, or changes a part of."""
    if not isinstance(getattr(node, "ctx", None), ast.Store):
        return None
    while isinstance(node, ast.Attribute | ast.Subscript):
        node = node.value
    return node.id if isinstance(node, ast.Name) else None


def _imported_from(node: ast.AST, there: ModuleType) -> ModuleType | None:
    """Return the project's module that a statement imports from; None for others."""
    if not isinstance(node, ast.ImportFrom):
        return None
    try:
        name = resolve_name("." * node.level + (node.module or ""), there.__package__)
    except ImportError:
        return None
    module = sys.modules.get(name)
    return module if module is not None and _is_the_projects(module) else None


def _bare(one: Any) -> Any:
    """Return the function behind decorators, such as `jax.jit`, and partial applications; other things as they are."""
    try:
        while (inner := inspect.unwrap(one.func if isinstance(one, partial) else one)) is not one:
            one = inner
    except Exception:  # anything can bear a name in a module, also what answers no questions
        return None
    return one


def _is_constant(value: Any) -> bool:
    """Whether a value is None, a number, a word, or a tuple, list or table of these."""
    if isinstance(value, dict):
        return all(map(_is_constant, (*value, *value.values())))
    if isinstance(value, tuple | list):
        return all(map(_is_constant, value))
    return value is None or isinstance(value, bool | int | float | str)


def _contents(value: Any) -> Any:
    """Return what an array, a set or a dataclass holds, or a tuple, list or table with these in it; None for others.

    Arrays are rounded: another machine or release may compute the same array with other last bits.
    """
    try:
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            return as_plain(value)  # as ids have it: a field that a release adds is no edit
        if isinstance(value, set | frozenset) and all(map(_is_constant, value)):
            value = sorted(map(repr, value))
        if isinstance(value, dict | tuple | list):
            each = [*value, *value.values()] if isinstance(value, dict) else value
            parts = [repr(one) if _is_constant(one) else _contents(one) for one in each]
            return None if None in parts else parts
        # To ask a module that is imported later would import it.
        if isinstance(value, type | ModuleType) or not (hasattr(value, "dtype") and hasattr(value, "__array__")):
            return None
        array = np.asarray(value)
        shape, largest = [*array.shape], 1.0
        if array.dtype.kind not in "biuSU":
            array = array.astype(complex)
            largest = float(np.abs(array[np.isfinite(array)]).max(initial=0.0))
            with np.errstate(all="ignore"):
                array = np.round(array / (largest or 1.0), 6) + 0.0  # no -0.0
        return [f"{largest:.6g}", shape, hashlib.sha256(array.tobytes()).hexdigest()]  # a whole data set may be named
    except Exception:  # of objects, a key of jax, or what answers no questions
        return None


def _parsed(one: Any) -> ast.Module:
    """Return the code of a class, a function or a project's module; empty where its text cannot be had."""
    try:
        return ast.parse(dedent(inspect.getsource(one)))
    except (OSError, TypeError, SyntaxError):
        return ast.Module([], [])


@cache
def _tree(one: Any) -> ast.Module:
    """Return the code of a class or function without what does not count; nobody may change it."""
    tree = _without_words(_parsed(one))
    for node in ast.walk(tree):
        for statement in _held_by_ids(node):
            statement.value = None
    return tree


def _without_words(tree: ast.Module) -> ast.Module:
    """Return code without its docstrings."""
    for node in ast.walk(tree):
        match node:
            case ast.Module() | ast.ClassDef() | ast.FunctionDef() | ast.AsyncFunctionDef():
                node.body = node.body[ast.get_docstring(node) is not None :] or [ast.Pass()]
    return tree


@cache
def _defaults(one: Any) -> Mapping[str, Any]:
    """Return the defaults of a class's fields by name, which ids hold only if it is a component's."""
    fields = [each for node in _parsed(one).body for each in _held_by_ids(node) if each.value]
    made = {word: each.value for each in fields if (word := ast.unparse(each.target)) not in _IN_THE_ID}
    values = {word: vars(one).get(word, ast) for word in made}  # a module is no constant
    return {word: repr(now) if _is_constant(now := values[word]) else _as_lists(made[word]) for word in made}


def _held_by_ids(node: ast.AST) -> list[ast.AnnAssign]:
    """Return a component's fields, and the class variables that ids or versions hold; none of what is no class."""
    body = node.body if isinstance(node, ast.ClassDef) else ()
    return [each for each in body if isinstance(each, ast.AnnAssign) and _is_in_the_id(each)]


def _as_lists(node: Any) -> Any:
    """Return a syntax tree as lists and words: under every release of Python the same, which `ast.unparse` is not."""
    if isinstance(node, ast.JoinedStr):  # some releases end it with an empty word
        node = ast.JoinedStr([part for part in node.values if getattr(part, "value", None) != ""])
    if isinstance(node, list):
        return [_as_lists(one) for one in node]
    if isinstance(node, ast.AST):
        fields = [(name, value) for name, value in ast.iter_fields(node) if name not in _SAYS_NOTHING]
        return [type(node).__name__, *([name, _as_lists(value)] for name, value in fields if value not in (None, []))]
    return node if isinstance(node, str) else [type(node).__name__, repr(node)]


def _is_in_the_id(statement: ast.AnnAssign) -> bool:
    """Whether a class's annotated variable is a field, or a class variable that ids or versions hold."""
    return "ClassVar" not in ast.unparse(statement.annotation) or ast.unparse(statement.target) in _IN_THE_ID


def _named(tree: ast.Module, module: ModuleType) -> Iterator[tuple[str, Any, _Variable]]:
    """Yield what a module has of the names that code uses, and what modules have that it names as "module.name"."""
    for node in ast.walk(tree):
        words, held = list[str](), node
        while isinstance(held, ast.Attribute):
            words.insert(0, held.attr)
            held = held.value
        if not isinstance(held, ast.Name) or held.id not in vars(module):
            continue
        name, value, variable = held.id, vars(module)[held.id], _Variable(module, held.id)
        for word in words:
            if not isinstance(value, ModuleType) or isinstance(value, Later) or not hasattr(value, word):
                break  # a module that is imported later is no project's
            name, value, variable = f"{name}.{word}", getattr(value, word), _Variable(value, word)
        else:
            yield name, value, variable
