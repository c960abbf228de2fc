"""Which operations of a kernel are alike in all parts of an element, as in the legs of a robot.

A thread computes a part, so that one instruction computes an operation of every leg. What the parts share (the torso)
each thread computes for itself; where a shared operation reads a part's number, it gets it from that part's thread.
Operations become a pack if there is one in every part, with the same name, which reads the same packs and shared
numbers. A sign is no operation here: parts that mirror each other differ by signs alone.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from evoclaims.kernels.trace.algebra import COMMUTATIVE
from evoclaims.kernels.trace.expressions import (
    Carried,
    Chosen,
    Expression,
    Input,
    Loop,
    LoopResult,
    Number,
    ScalarOperation,
    in_order,
    is_known,
    operands_of,
)

Place = tuple[int, int]
"""An array that is read, and where in it a number is."""
Term = tuple[Number, int]
"""A number, and whether it counts as it is (1) or negated (-1)."""
Product = tuple[Term, ...]
"""A number, or two factors."""
WORTHWHILE: Final = 0.75
"""Up to which `Parts.share` threads for parts are the faster way: an ant's is 0.6, a half-cheetah's would be 0.9."""
SUMS: Final = {"add": ("add", None), "sub": ("add", 1), "fma": ("fma", None), "fms": ("fma", 0), "fnma": ("fma", 1)}
"""Sums by the operation whose sign of an operand is changed, and which operand's."""
FACTORS: Final = {"mul": 0, "div": 0, "fma": 1}
"""The first of two operands of which only the product's sign matters."""


def term(number: Number) -> Term:
    """Return a number without its negations, and its sign; of a loop's result what the loop carries."""
    sign = 1
    while isinstance(number, ScalarOperation) and number.name == "neg" and number.dtype.kind == "f":
        number, sign = number.operands[0], -sign
    if isinstance(number, LoopResult):
        number = number.loop.carried[number.place]
    return (-number, 1) if is_known(number) and sign < 0 else (number, sign)


def terms(operation: ScalarOperation) -> tuple[str, list[Term]]:
    """Return an operation's name and operands; those that differ by signs alone have the same name."""
    operands = [term(o) for o in operation.operands]
    if operation.dtype.kind != "f":
        return operation.name, operands
    name, flipped = SUMS.get(operation.name, (operation.name, None))
    if flipped is not None:
        operands[flipped] = _negated(operands[flipped])
    if name in FACTORS:
        _move_sign(operands, FACTORS[name])
    return name, operands


def _move_sign(operands: list[Term], first: int) -> None:
    """Give the sign of the second of two factors to the first."""
    number, sign = operands[first + 1]
    if sign < 0:
        operands[first : first + 2] = [_negated(operands[first]), (number, 1)]


def _negated(operand: Term) -> Term:
    number, sign = operand
    return (-number, 1) if is_known(number) else (number, -sign)


@dataclass(frozen=True)
class Total:
    """A sum of which every part has terms of its own.

    Attributes:
        others: the terms that are not alike in all parts.
        alike: for each term of a part, that of every part.
    """

    others: list[Product]
    alike: list[list[Product]]

    def read(self) -> list[Number]:
        """Return the numbers that it is made of."""
        products = [*self.others, *(product for every in self.alike for product in every)]
        return [number for product in products for number, _ in product]


def work(numbers: Sequence[Number]) -> list[list[Expression] | Loop] | None:
    """Return expressions in the order of their computation; a loop comes before the parts of its round.

    These are three if the round has a choice: what is before, and both ways.

    Returns:
        None if there is a loop inside another, or a choice outside of loops.
    """
    found: list[list[Expression] | Loop] = []
    seen: set[int] = set()

    def add(needed: Iterable[Expression], also: set[int]) -> None:
        new = [e for e in needed if id(e) not in also]
        also.update(map(id, new))
        found.append(new)

    order = in_order(numbers)
    for expression in order:
        if not isinstance(expression, LoopResult) or id(expression.loop) in seen:
            continue
        around, choice = expression.loop, expression.loop.choice
        add(in_order([*around.start, *around.taken]), seen)
        found.append(around)
        seen |= {id(around), *map(id, around.carried)}
        inside = set(seen)
        before = around.results if choice is None else [choice.condition, *choice.taken]
        add(in_order(before), inside)
        for way in () if choice is None else (choice.whole, choice.short):
            add(in_order(way), set(inside))
    add(order, seen)
    inner = [e for at, part in enumerate(found[:-1]) if isinstance(part, list) for e in part]
    loops = [part for part in found if isinstance(part, Loop)]
    nested = any(isinstance(e, LoopResult) and id(e.loop) not in {id(one) for one in loops} for e in inner)
    return None if nested or any(isinstance(e, Chosen) for e in (*inner, *found[-1])) else found  # type: ignore[misc]


class Parts:
    """What is packed.

    Attributes:
        count: parts of an element.
        part_of: the part that a number belongs to, by its id; others are shared.
        pack_of: its pack.
        packs: the number of each part.
        totals: how shared sums over the parts are made, by the sum's id.
    """

    def __init__(self, numbers: Sequence[Number], places: Sequence[Sequence[Place]]) -> None:
        """Find packs; there are none in a kernel that `work` cannot order.

        Args:
            numbers: the results.
            places: which numbers that are read belong to each part, in the same order.
        """
        self.count = len(places)
        self.part_of: dict[int, int] = {}
        self.pack_of: dict[int, int] = {}
        self.packs: list[list[Number]] = []
        self._belongs = {place: (part, at) for part, mine in enumerate(places) for at, place in enumerate(mine)}
        self._keys: dict[int, int] = {}  # equal for numbers that may be in one pack
        self._numbered: dict[Any, int] = {}
        self._depth: dict[int, int] = {}
        self._mixed: set[int] = set()  # shared numbers made of parts': any may stand for any in a key
        self.totals: dict[int, Total] = {}
        self.work = work(numbers) or []
        self._wanted = self._only_users()
        for part in self.work:
            if isinstance(part, Loop):
                self._carry(part)
            else:
                self._pack(part)
        self.totals = self._sums(numbers)

    def share(self) -> float:
        """Return how many operations a thread has of those that one for all parts would have; 1 if none is found."""
        operations = [id(e) for e in self._everything() if isinstance(e, ScalarOperation)]
        units = {self.pack_of.get(operation, -operation) for operation in operations}
        return len(units) / len(operations) if operations else 1.0

    def _everything(self) -> list[Expression]:
        return [e for part in self.work if isinstance(part, list) for e in part]

    def arranged(self, operation: ScalarOperation) -> tuple[str, list[Term]]:
        """Return `terms`, in an order that is the same in all parts."""
        name, operands = terms(operation)

        def order(operand: Term) -> tuple[str, int]:
            return str(self._key(operand[0])), self.pack_of.get(id(operand[0]), -1)

        if name in COMMUTATIVE:
            operands.sort(key=order)
        if name == "fma":
            operands[1:] = sorted(operands[1:], key=order)
        if name in FACTORS:
            _move_sign(operands, FACTORS[name])
        return name, operands

    def _only_users(self) -> dict[int, int]:
        """Return the part that alone needs a number that is made of shared ones."""
        starts = {
            id(carried): start
            for loop in self.work
            if isinstance(loop, Loop)
            for carried, start in zip(loop.carried, loop.start, strict=True)
        }
        part: dict[int, int | None] = {}
        users: dict[int, list[int]] = defaultdict(list)
        free: set[int] = set()  # of what is made of shared numbers

        def of(number: Number) -> int | None:
            base = term(number)[0]
            while id(base) in starts:
                base = term(starts[id(base)])[0]
            return part.get(id(base))

        order = self._everything()
        for e in order:
            if isinstance(e, Input):
                part[id(e)] = self._belongs.get((e.array, e.place), (None, 0))[0]
                parts = {part[id(e)]} - {None}
            else:
                parts = {of(o) for o in operands_of(e)} - {None} if isinstance(e, ScalarOperation) else set()
                part[id(e)] = next(iter(parts)) if len(parts) == 1 else None
                for o in operands_of(e):
                    users[id(o)].append(id(e))
            if not parts:
                free.add(id(e))
        wanted = {}
        for e in reversed(order):
            if id(e) in free:
                alone = {part.get(user) for user in users[id(e)]}
                only = next(iter(alone)) if len(alone) == 1 else None
                if only is not None:
                    part[id(e)] = wanted[id(e)] = only
        return wanted

    def _add(self, numbers: Sequence[Number]) -> None:
        for part, number in enumerate(numbers):
            self.part_of[id(number)], self.pack_of[id(number)] = part, len(self.packs)
        self.packs.append(list(numbers))

    def _carry(self, around: Loop) -> None:
        """Pack what a loop carries as its start is."""
        packs: dict[int, dict[int, Carried]] = defaultdict(dict)
        for carried, start in zip(around.carried, around.start, strict=True):
            base, sign = term(start)
            self._keys[id(carried)], self._depth[id(carried)] = self._number(("shared", id(carried))), 0
            if id(base) in self.part_of and sign > 0 and self.part_of[id(base)] not in packs[self.pack_of[id(base)]]:
                packs[self.pack_of[id(base)]][self.part_of[id(base)]] = carried
        for pack in packs.values():
            if len(pack) == self.count:
                self._add([pack[part] for part in range(self.count)])
                for carried in pack.values():
                    self._keys[id(carried)] = self._number(("pack", len(self.packs) - 1))

    def _pack(self, section: Sequence[Expression]) -> None:
        """Find the packs of a section: the longer the chains before an operation, the later."""
        levels: dict[int, list[Expression]] = defaultdict(list)
        for e in section:
            if term(e)[0] is e:
                before = [self._depth[id(term(o)[0])] for o in operands_of(e)] if isinstance(e, ScalarOperation) else []
                self._depth[id(e)] = 1 + max(before, default=-1)
                levels[self._depth[id(e)]].append(e)
        for level in sorted(levels):
            alike: dict[int, dict[int, list[Expression]]] = defaultdict(lambda: defaultdict(list))
            for e in levels[level]:
                key, part = self._key_and_part(e)
                self._keys[id(e)] = self._number(key)
                if part is None:
                    self._mark(e)
                else:
                    alike[self._keys[id(e)]][part].append(e)
            for found in alike.values():
                self._match(found)

    def _key_and_part(self, e: Expression) -> tuple[Any, int | None]:
        """Return what a number has in common with those of its pack, and the part that it may belong to."""
        if isinstance(e, Input):
            part, at = self._belongs.get((e.array, e.place), (self._wanted.get(id(e)), -1))
            return (("shared", id(e)) if part is None else ("input", e.array, at)), part
        assert isinstance(e, ScalarOperation)
        parts = {self.part_of.get(id(term(o)[0])) for o in operands_of(e)} - {None}
        part = next(iter(parts)) if len(parts) == 1 else None if parts else self._wanted.get(id(e))
        name, operands = self.arranged(e)
        kinds = e.dtype.kind + e.operands[-1].dtype.kind
        return (name, kinds, part is None, *(self._key(number) for number, _ in operands)), part

    def _number(self, key: Any) -> int:
        """Return a key's number: the same in every process, unlike ids."""
        return self._numbered.setdefault(key, len(self._numbered))

    def _key(self, number: Number) -> Any:
        if is_known(number):
            return "known"
        return "mixed" if id(number) in self._mixed else self._keys[id(number)]

    def _mark(self, e: Expression) -> None:
        """Remember whether a shared number is made of parts'."""
        read = [id(term(o)[0]) for o in operands_of(e)] if isinstance(e, ScalarOperation) else []
        if any(r in self.part_of or r in self._mixed for r in read):
            self._mixed.add(id(e))

    def _match(self, found: Mapping[int, Sequence[Expression]]) -> None:
        """Make packs of numbers of a key, by part; those beyond the fewest of a part are shared."""
        packs: list[list[Expression]] = []
        left = {part: list(numbers) for part, numbers in found.items()}
        while len(left) == self.count and all(left.values()):
            first = left[0].pop(0)
            pack = [first]
            for part in range(1, self.count):
                best = max(left[part], key=lambda other: self._common(first, other))
                left[part] = [e for e in left[part] if e is not best]
                pack.append(best)
            packs.append(pack)
        for pack in packs:
            self._add(pack)
        for numbers in left.values():
            for e in numbers:
                self._mark(e)

    def _common(self, one: Expression, other: Expression) -> int:
        """Return how many operands of two operations are shared, or in the same pack."""
        if not isinstance(one, ScalarOperation) or not isinstance(other, ScalarOperation):
            return 0
        pairs = zip(self.arranged(one)[1], self.arranged(other)[1], strict=True)
        return sum(
            a is b or (not is_known(a) and self.pack_of.get(id(a), -1) == self.pack_of.get(id(b), -2))
            for (a, _), (b, _) in pairs
        )

    def _sums(self, numbers: Sequence[Number]) -> dict[int, Total]:
        """Find the shared sums over parts. Terms are added in another order than before, each part's first."""
        order = self._everything()
        uses: Counter[int] = Counter(id(term(n)[0]) for n in numbers)
        sums: dict[int, ScalarOperation] = {}
        terms_of_sums: dict[int, ScalarOperation] = {}  # and products
        added: set[int] = set()  # sums that are a term of another
        for e in order:
            read = [id(term(o)[0]) for o in e.operands] if isinstance(e, ScalarOperation) else []
            if term(e)[0] is e:
                uses.update(read)
            if not isinstance(e, ScalarOperation) or e.dtype.kind != "f" or id(e) not in self._mixed:
                continue
            if e.name == "mul":
                terms_of_sums[id(e)] = e
            if e.name in SUMS:
                sums[id(e)] = terms_of_sums[id(e)] = e
                added.update(read[:1] if SUMS[e.name][0] == "fma" else read)
        for thing in self.work:
            if isinstance(thing, Loop):
                choice = thing.choice
                ends = thing.results if choice is None else (choice.condition, *choice.whole, *choice.short)
                uses.update(id(term(n)[0]) for n in (*ends, *thing.start))
        inner = {number for number in added if number in terms_of_sums and uses[number] == 1}
        totals = {}
        for number, operation in sums.items():
            if number not in inner:
                total = self._total(self._flat(operation, 1, inner))
                if total.alike:
                    totals[number] = total
        return totals

    def _flat(self, operation: ScalarOperation, sign: int, inner: set[int]) -> list[Product]:
        """Return the terms of a sum, also of sums that are its terms."""
        name, operands = terms(operation)
        if name == "mul":
            a, b = operands
            return [(_negated(a) if sign < 0 else a, b)]
        products: list[Product] = []
        for number, own in operands if name == "add" else operands[:1]:
            if id(number) in inner:
                products += self._flat(number, sign * own, inner)
            else:
                products.append((_negated((number, own)) if sign < 0 else (number, own),))
        if name == "fma":
            a, b = operands[1:]
            products.append((_negated(a) if sign < 0 else a, b))
        return products

    def _total(self, products: Sequence[Product]) -> Total:
        """Return a sum's terms, put together where all parts have one alike."""
        found: dict[Any, dict[int, list[Product]]] = defaultdict(lambda: defaultdict(list))
        others = []
        for product in products:
            parts = {self.part_of[id(number)] for number, _ in product if id(number) in self.part_of}
            if len(parts) != 1:
                others.append(product)
                continue
            keyed = sorted((str(self._place(number)), at) for at, (number, _) in enumerate(product))
            found[tuple(key for key, _ in keyed)][next(iter(parts))].append(tuple(product[at] for _, at in keyed))
        alike = []
        for by_part in found.values():
            fewest = min(len(by_part[part]) for part in range(self.count))
            alike += [[by_part[part][at] for part in range(self.count)] for at in range(fewest)]
            others += [product for part in by_part for product in by_part[part][fewest:]]
        return Total(others, alike)

    def _place(self, number: Number) -> tuple[str, int]:
        """Return the pack of a number, or which shared ones it is one of."""
        if is_known(number):
            return "known", 0
        pack = self.pack_of.get(id(number))
        return ("shared", self._keys[id(number)]) if pack is None else ("pack", pack)
