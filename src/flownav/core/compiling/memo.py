"""Work that Numba does again at every line, done once: typing of operators, looks into signatures and instructions.

All of this is only in force inside `memoising()`, and changes no result. A part that this version of Numba does not
have stays as Numba has it, and with `FLOWNAV_PLAIN=1` all do (docs/explanation/numba.md).
"""

import operator
from collections.abc import Hashable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from functools import cache
from types import FunctionType
from typing import Any, cast

from numba.core import base, errors, event, ir, postproc, ssa, targetconfig, transforms, types
from numba.core.datamodel.models import TupleModel
from numba.core.runtime.context import NRTContext

from flownav.core.compiling.level import Leanness

OPERATORS = frozenset(function for function in vars(operator).values() if callable(function))
_typed: dict[tuple[Any, ...], Any] = {}
_hashes: dict[int, tuple[int, Any]] = {}  # by id, each with its type, which is kept alive by that


@contextmanager
def memoising() -> Iterator[None]:
    """Remember inside the block, where this version of Numba has these parts."""
    with ExitStack() as stack:
        for owner, name, replacement in PATCHES if Leanness.wanted else ():
            if hasattr(owner, name):
                stack.enter_context(_replaced(owner, name, replacement))
        yield


@contextmanager
def _replaced(owner: Any, name: str, replacement: Any) -> Iterator[None]:
    own = vars(owner).get(name)
    setattr(owner, name, replacement)
    try:
        yield
    finally:
        if own is None:
            delattr(owner, name)
        else:
            setattr(owner, name, own)


def _type_of_call(self: Any, context: Any, args: Any, kws: Any) -> Any:
    """The signature of a function on these types; of an operator also the error that there is none."""
    if kws or self.typing_key not in OPERATORS:
        return _type_of_equation(self, context, args, kws)
    known = self, tuple(args)
    if known not in _typed:
        try:
            _typed[known] = _original_type_of_call(self, context, args, kws)
        except errors.TypingError as error:
            _typed[known] = error
    found = _typed[known]
    if isinstance(found, Exception):
        raise found
    return found


def _type_of_equation(self: Any, context: Any, args: Any, kws: Any) -> Any:
    """The signature of any other function; what is compiled for these types already is not looked for again."""
    if kws or not isinstance(self.typing_key, FunctionType):
        return _original_type_of_call(self, context, args, kws)
    known = self, tuple(args), context
    if known not in _typed:
        _typed[known] = _original_type_of_call(self, context, args, kws)
    return _typed[known]


def _variables(self: Any, value: Any) -> list[Any]:
    """The variables that a part of an instruction names."""
    found: list[Any] = []
    _collect(value if isinstance(value, dict | list | tuple) else (value,), found)
    return found


def _collect(value: Any, found: list[Any]) -> None:
    """Most parts of an instruction are variables, or plain texts and numbers, which is seen at once."""
    for part in value.values() if isinstance(value, dict) else value:
        kind = type(part)
        if kind is ir.Var:
            found.append(part)
        elif kind in PLAIN:
            continue
        elif isinstance(part, ir.Inst):
            found.extend(part.list_vars())
        elif isinstance(part, dict | list | tuple):
            _collect(part, found)
        elif isinstance(part, ir.Var):
            found.append(part)


def _renamed(states: Any, block: Any, handler: Any) -> Iterator[Any]:
    """Results of each statement of a block; Numba also puts every one of them into words for a log."""
    for statement in block.body:
        yield (handler.on_assign if isinstance(statement, ir.Assign) else handler.on_other)(states, statement)


def _hash_of_type(self: Any) -> int:
    """The hash of a type, which Numba computes anew from all its parts; that of a mere copy is not kept."""
    known = _hashes.get(id(self))
    if known is not None:
        return known[0]
    found = hash(self.key)
    if "_code" in self.__dict__:
        _hashes[id(self)] = found, self
    return found


def _counted_parts(self: Any, builder: Any, kind: Any, value: Any) -> list[Any]:
    """The reference counts in a value; Numba takes every field of every tuple out of it to find that most have none."""
    if not is_counted(self._context.data_model_manager, kind):
        return []
    return list(_original_counted_parts(self, builder, kind, value))


@cache
def is_counted(models: Any, kind: Any) -> bool:
    """Whether a value of this type holds something with a reference count."""
    return bool(models[kind].contains_nrt_meminfo())


def _option_values(self: Any) -> dict[str, Any]:
    """The compiler's options, which Numba compares and hashes at every lookup, property by property."""
    values: dict[str, Any] = _defaults(cast(Hashable, type(self))) | self._values
    return values


@cache
def _defaults(config: Hashable) -> dict[str, Any]:
    options: dict[str, Any] = vars(config)["options"]
    return {name: option.default for name, option in options.items()}


def _no_timer(*_: Any) -> Any:
    """Numba times its locks at every call of LLVM, for a note on each kernel that is never read."""
    return nullcontext()


def _prepared(self: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
    """The blocks in order; how long each variable lives is computed where somebody asks for it."""
    if emit_dels or self.func_ir.is_generator:
        _original_prepared(self, emit_dels, extend_lifetimes)
        return
    self.func_ir.blocks = transforms.canonicalize_cfg(self.func_ir.blocks)
    self.func_ir.variable_lifetime = postproc.VariableLifetime(self.func_ir.blocks)
    self.func_ir.generator_info = None


def _returned(self: Any, builder: Any, value: Any) -> Any:
    """A tuple as it is returned, which Numba takes apart and puts together even where that changes nothing."""
    return value if self.get_value_type() == self.get_data_type() else _original_returned(self, builder, value)


def _received(self: Any, builder: Any, value: Any) -> Any:
    """A tuple that was returned, as a value."""
    return value if self.get_value_type() == self.get_data_type() else _original_received(self, builder, value)


def _own(owner: Any, name: str) -> Any:
    """A part of Numba; None where this version has none of the name, and `memoising` leaves it alone."""
    return getattr(owner, name, None)


_original_type_of_call = _own(types.Function, "get_call_type")
_original_counted_parts = _own(NRTContext, "get_meminfos")
_original_prepared = _own(postproc.PostProcessor, "run")
_original_returned, _original_received = _own(TupleModel, "as_return"), _own(TupleModel, "from_return")
PLAIN = frozenset({str, int, float, bool, type(None), ir.Loc, ir.Scope})
PATCHES: tuple[tuple[Any, str, Any], ...] = (
    (types.Function, "get_call_type", _type_of_call),
    (base, "_has_loc", cache(_own(base, "_has_loc") or bool)),
    (ir.Inst, "_rec_list_vars", _variables),
    (ssa, "_run_ssa_block_pass", _renamed),
    (types.Type, "__hash__", _hash_of_type),
    (NRTContext, "get_meminfos", _counted_parts),
    (event, "install_timer", _no_timer),
    (targetconfig.TargetConfig, "values", _option_values),
    (postproc.PostProcessor, "run", _prepared),
    (TupleModel, "as_return", _returned),
    (TupleModel, "from_return", _received),
)
