"""A function of Python, with the kinds of its arguments, as a function of LLVM.

The part of Python that is understood: assignments, ``for`` over ``range``, ``while``, ``if``, ``break``,
``continue``, ``return`` of numbers, arithmetic, comparisons, ``and``, ``or``, ``not``, conditional expressions, named
tuples and their fields, indices of arrays, their ``shape``, ``np.empty`` and ``np.zeros`` of small arrays that are not
returned, and calls of the functions of `arithmetic`, of `Primitive`, and of other functions, native or plain: these are
inlined, unless they are compiled separately. It computes bit for bit what Python does, with these exceptions: a power
with a known integer exponent is a product; integers have 64 bits and wrap; numbers of several kinds are promoted as
NumPy promotes arrays of them; a float divided by zero, or a function of ``math`` outside its domain, gives what
IEEE 754 states; ``hypot``, ``gamma`` and ``lgamma`` are those of the C library; powers of 2.0 and powers 0.5 are LLVM's
``exp2`` and ``sqrt``, which may differ from Python's in the last bit; an index is not checked and does not count from
the end. Numbers and arrays of a module are those of the first call.

Everything else that would differ is refused: a name that may have no value where it is read, a return that may be
omitted, ``or`` for a value, a second name for an array that a loop makes again, closures, arguments with defaults.
"""

from __future__ import annotations

import ast
from collections.abc import Sequence

from llvmlite import ir

from flocking.formula.native.arithmetic import converted, number
from flocking.formula.native.entries import add_entry
from flocking.formula.native.expressions import Expressions
from flocking.formula.native.kinds import (
    B1,
    F8,
    I4,
    I8,
    LINE,
    U8,
    Argument,
    Array,
    Constant,
    Kind,
    Number,
    Record,
    RecordKind,
    Several,
    UntranslatableError,
    Value,
    flat,
)
from flocking.formula.native.scopes import Loop, Scope, Source, WiderError, result_name


def translate(
    name: str, source: Source, arguments: Sequence[Argument]
) -> tuple[str, tuple[Kind, ...], tuple[str, ...]]:
    """Text of an LLVM module with the function, the kinds of what it returns, and the native functions it calls.

    The function takes a pointer behind its last argument, to eight bytes for each number it returns. It returns the
    number of a fault, see `flocking.formula.native.faults`.

    Parameters
    ----------
    source
        The function.

    Raises
    ------
    UntranslatableError
        When it holds what native functions cannot.
    """
    wider: dict[tuple[str, str], Kind] = {}
    while True:
        try:
            translator = _Translator(name, source, arguments, wider)
            return str(translator.module), translator.found, tuple(translator.called)
        except WiderError:
            continue
        except UntranslatableError as error:
            raise UntranslatableError(f"{source.node.name} cannot be compiled: {error}") from None


class _Translator(Expressions):
    def __init__(
        self, name: str, source: Source, arguments: Sequence[Argument], wider: dict[tuple[str, str], Kind]
    ) -> None:
        module = ir.Module(name)
        types: list[ir.Type] = []
        for part in flat(arguments):
            types += [part.stored] if isinstance(part, Kind) else [part.stored.as_pointer(), *[I8.type] * part.axes]
        shape = ir.FunctionType(I4.type, [*types, I8.type.as_pointer()])
        function = ir.Function(module, shape, name)
        # What has no register lies on the stack. Vectors there are read and written whole where they begin with a line
        # of memory; elsewhere each lies in two lines, and one in two pages, which is slower by a third.
        function.attributes.alignstack = LINE
        entry = function.append_basic_block("entry")
        begin, leave = function.append_basic_block("begin"), function.append_basic_block("leave")
        super().__init__(module, entry, ir.IRBuilder(begin), wider)
        self.failed = leave
        self.scope = Scope("", source, leave)
        given = list(function.args)
        names = [a.arg for a in source.node.args.args]
        if len(names) != len(arguments):
            raise UntranslatableError(f"it has {len(names)} arguments, and {len(arguments)} kinds are stated")
        for text, kind in zip(names, arguments, strict=True):
            self.store(text, self._received(kind, given))
        self._function_body(source)
        self.builder.position_at_end(leave)
        self.found = self._finish(given[0])
        ir.IRBuilder(entry).branch(begin)
        add_entry(module, function, arguments)

    def _received(self, kind: Argument, given: list[ir.Value]) -> Value:
        """Value of an argument; what it is made of is taken from the front of ``given``."""
        if isinstance(kind, RecordKind):
            return Record(tuple(self._received(field, given) for field in kind.fields), kind.record)
        if isinstance(kind, Kind):
            code = given.pop(0)
            return Number(kind, self.builder.trunc(code, B1.type) if kind == B1 else code)
        data, *shape = given[: 1 + kind.axes]
        del given[: 1 + kind.axes]
        return Array(kind, data, tuple(shape))

    def _finish(self, place: ir.Value) -> tuple[Kind, ...]:
        if self.scope.returned is not None:
            raise UntranslatableError("it returns what is no number")
        found = []
        for k in range(self.scope.results or 0):
            x = self.load(result_name(k))
            assert isinstance(x, Number)
            kind = F8 if x.kind.real else U8 if x.kind == U8 else I8
            at = self.builder.gep(place, [ir.Constant(I8.type, k)])
            code = converted(self.builder, x, kind).code
            self.builder.store(code, self.builder.bitcast(at, kind.type.as_pointer()))
            found.append(kind if x.kind != B1 else B1)
        self.free_all()
        self.builder.ret(self.builder.load(self.fault))
        return tuple(found)

    def _function_body(self, source: Source) -> None:
        self._body(source.node.body)
        if not self.builder.block.is_terminated:
            if self.scope.results:
                raise UntranslatableError(f"{source.node.name}, which may end without the return of a value")
            self.builder.branch(self.scope.leave)
        self.scope.assigned |= {result_name(k) for k in range(self.scope.results or 0)}

    def in_place(self, source: Source, values: Sequence[Value]) -> Value:
        """Value of a function translated at the place of its call."""
        self.calls += 1
        outer = self.scope
        path = f"{outer.path}/{source.node.name}:{self.calls}"
        if path.count(f"/{source.node.name}:") > 1:
            raise UntranslatableError(f"{source.node.name}, which calls itself")
        leave = self.builder.append_basic_block("leave")
        scope = self.scope = Scope(path, source, leave)
        if len(source.node.args.args) != len(values):
            raise UntranslatableError(f"{source.node.name} with {len(values)} arguments")
        for argument, value in zip(source.node.args.args, values, strict=True):
            self.store(argument.arg, value)
        self._function_body(source)
        self.builder.position_at_end(leave)
        found = scope.returned
        if found is None:
            numbers = tuple(self.load(result_name(k)) for k in range(scope.results or 0))
            found = numbers[0] if scope.results == 1 else Several(numbers)
        self.scope = outer
        return found

    # Statements

    def _body(self, statements: Sequence[ast.stmt]) -> None:
        for node in statements:
            if self.builder.block.is_terminated:
                return
            handler = getattr(self, f"_{type(node).__name__.lower()}", None)
            if handler is None:
                raise UntranslatableError(f"the statement {type(node).__name__}, line {node.lineno}")
            handler(node)

    def _pass(self, node: ast.Pass) -> None:
        pass

    def _expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            self.value(node.value)

    def _return(self, node: ast.Return) -> None:
        nothing = node.value is None or (isinstance(node.value, ast.Constant) and node.value.value is None)
        value = Several(()) if node.value is None or nothing else self.value(node.value)
        values = value.values if isinstance(value, Several) else (value,)
        scope = self.scope
        if any(isinstance(x, Array) or (isinstance(x, Number) and x.kind.lanes) for x in values):
            if scope.loops or scope.results is not None or node is not scope.source.node.body[-1]:
                raise UntranslatableError("a return of arrays or lanes that is not the only one, at the end")
            scope.returned = value
        else:
            if scope.results not in (None, len(values)):
                raise UntranslatableError("returns of different numbers of values")
            scope.results = len(values)
            for k, x in enumerate(values):
                self.store(result_name(k), number(x))
        self.builder.branch(scope.leave)

    def _assign(self, node: ast.Assign) -> None:
        value = self.value(node.value)
        for target in node.targets:
            self._bind(target, value)

    def _annassign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self._bind(node.target, self.value(node.value))

    def _augassign(self, node: ast.AugAssign) -> None:
        if isinstance(node.target, ast.Subscript):
            data, kind = self.place(node.target)
            before = self.element(data, kind)
            self.assign(data, kind, self.combined(node.op, before, self.value(node.value)))
        elif isinstance(node.target, ast.Name):
            before = self.load(node.target.id)  # type: ignore[assignment]
            self.store(node.target.id, self.combined(node.op, before, self.value(node.value)))
        else:
            raise UntranslatableError("an assignment to an attribute")

    def _bind(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            self.store(target.id, value)
        elif isinstance(target, ast.Tuple):
            if not isinstance(value, Several) or len(value.values) != len(target.elts):
                raise UntranslatableError("values that do not fit the names they are assigned to")
            for part, each in zip(target.elts, value.values, strict=True):
                self._bind(part, each)
        elif isinstance(target, ast.Subscript):
            self.assign(*self.place(target), value)
        else:
            raise UntranslatableError(f"an assignment to {type(target).__name__}")

    def _for(self, node: ast.For) -> None:
        call = node.iter
        if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "range") or (
            "range" in self.scope.bound or "range" in self.scope.source.known or call.keywords
        ):
            raise UntranslatableError("a loop over anything but a range")
        if not isinstance(node.target, ast.Name) or node.orelse:
            raise UntranslatableError("a loop of another form than 'for name in range(...)'")
        bounds = [self.value(a) for a in call.args]
        if not 1 <= len(bounds) <= 3 or any(number(x).kind.real for x in bounds):
            raise UntranslatableError(f"the range {ast.unparse(call)}")
        first, last = (Constant(0), bounds[0]) if len(bounds) == 1 else bounds[:2]
        step = bounds[2] if len(bounds) == 3 else Constant(1)
        if not isinstance(step, Constant) or not isinstance(step.value, int) or not step.value:
            raise UntranslatableError("a range whose step is not known")
        b = self.builder
        counter = self.variable(I8)
        b.store(converted(b, number(first), I8).code, counter)
        end = converted(b, number(last), I8).code
        test, body = b.append_basic_block("test"), b.append_basic_block("body")
        again, after = b.append_basic_block("again"), b.append_basic_block("after")
        b.branch(test)
        b.position_at_end(test)
        now = b.load(counter)
        b.cbranch(b.icmp_signed("<" if step.value > 0 else ">", now, end), body, after)
        b.position_at_end(body)
        before = set(self.scope.assigned)
        self.store(node.target.id, Number(I8, now))
        loop = Loop(again, after)
        self._repeated(node.body, loop)
        known = [x.value for x in (first, last, step) if isinstance(x, Constant)]
        ways = loop.left + loop.turned
        self.scope.assigned = set.intersection(*ways) if len(known) == 3 and range(*known) and ways else before
        b.position_at_end(again)
        b.store(b.add(b.load(counter), ir.Constant(I8.type, step.value), flags=("nsw",)), counter)
        b.branch(test)
        b.position_at_end(after)

    def _while(self, node: ast.While) -> None:
        if node.orelse:
            raise UntranslatableError("a loop with an else")
        b = self.builder
        test, body, after = (b.append_basic_block(name) for name in ("test", "body", "after"))
        b.branch(test)
        b.position_at_end(test)
        endless = isinstance(node.test, ast.Constant) and bool(node.test.value)
        before, loop = set(self.scope.assigned), Loop(test, after)
        if endless:
            b.branch(body)
        else:
            b.cbranch(self.truth(node.test), body, after)
        b.position_at_end(body)
        self._repeated(node.body, loop)
        self.scope.assigned = before if not endless else set.intersection(*loop.left) if loop.left else before
        b.position_at_end(after)
        if endless and not loop.left:
            b.unreachable()

    def _repeated(self, statements: Sequence[ast.stmt], loop: Loop) -> None:
        self.scope.loops.append(loop)
        self.loops += 1
        self._body(statements)
        if not self.builder.block.is_terminated:
            loop.turned.append(set(self.scope.assigned))
            self.builder.branch(loop.again)
        self.loops -= 1
        self.scope.loops.pop()

    def _break(self, node: ast.Break) -> None:
        self.scope.loops[-1].left.append(set(self.scope.assigned))
        self.builder.branch(self.scope.loops[-1].after)

    def _continue(self, node: ast.Continue) -> None:
        self.scope.loops[-1].turned.append(set(self.scope.assigned))
        self.builder.branch(self.scope.loops[-1].again)

    def _if(self, node: ast.If) -> None:
        test = self.test(node.test)
        if isinstance(test, Constant):
            self._body(node.body if test.value else node.orelse)
            return
        b = self.builder
        yes, no, after = (b.append_basic_block(name) for name in ("yes", "no", "after"))
        b.cbranch(converted(b, number(test), B1).code, yes, no)
        before, left = self.scope.assigned, []
        for block, statements in ((yes, node.body), (no, node.orelse)):
            b.position_at_end(block)
            self.scope.assigned = set(before)
            self._body(statements)
            if not b.block.is_terminated:
                left.append(self.scope.assigned)
                b.branch(after)
        self.scope.assigned = set.intersection(*left) if left else before
        b.position_at_end(after)
        if not left:
            b.unreachable()
