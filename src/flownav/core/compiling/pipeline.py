"""Numba's passes for what equations and kernels are made of, and no others.

Numba prepares every function for closures, context managers, array expressions, literal loops and more, and computes
the lifetimes of its variables anew after each pass (nine times a function). Equations and kernels need few of these,
and the lifetimes only where something is counted; a function that holds something unusual takes Numba's own way.
"""

import types as python_types
from typing import Any, NamedTuple

from numba.core import transforms, types
from numba.core.analysis import dead_branch_prune
from numba.core.compiler import Compiler, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.typed_passes import (
    InlineOverloads,
    IRLegalization,
    NativeLowering,
    NoPythonBackend,
    NopythonTypeInference,
    PreLowerStripPhis,
)
from numba.core.untyped_passes import (
    DeadBranchPrune,
    FixupArgs,
    GenericRewrites,
    IRProcessing,
    ReconstructSSA,
    RewriteDynamicRaises,
    RewriteSemanticConstants,
    TranslateByteCode,
)

from flownav.core.compiling.memo import is_counted

PRESENT = (types.BaseTuple, types.CPointer, types.Array)


class _Present(NamedTuple):
    """An argument that is not None, as Numba's search for dead branches looks at it: as at a literal."""

    literal_type: Any


@register_pass(mutates_CFG=True, analysis_only=False)
class AbsentBranchPrune(DeadBranchPrune):
    """Numba's pass, which by itself takes `argument is None` for decided only where the argument is None."""

    _name = "absent_branch_prune"

    def run_pass(self, state: Any) -> bool:
        """Drop the branches that these types of arguments never take, before anything in them is compiled."""
        kinds = [_Present(kind) if isinstance(kind, PRESENT) else kind for kind in state.args]
        dead_branch_prune(state.func_ir, kinds)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class LeanLegalization(IRLegalization):
    """Numba's pass, which ends the life of each variable for the sake of its reference count."""

    _name = "lean_legalization"

    def run_pass(self, state: Any) -> bool:
        """Leave a function as it is that has no variable with a reference count."""
        models = state.targetctx.data_model_manager
        if any(is_counted(models, kind) for kind in set(state.typemap.values())):
            return bool(super().run_pass(state))
        return False


PASSES = (
    TranslateByteCode,
    FixupArgs,
    IRProcessing,
    RewriteSemanticConstants,
    AbsentBranchPrune,
    GenericRewrites,
    RewriteDynamicRaises,
    ReconstructSSA,
    AbsentBranchPrune,
    NopythonTypeInference,
    PreLowerStripPhis,
    InlineOverloads,
    LeanLegalization,
    NativeLowering,
    NoPythonBackend,
)
UNUSUAL_NAMES = {"isinstance", "literal_unroll", "literally", "prange", "objmode"}
UNUSUAL_FLAGS = 0x20 | 0x80 | 0x100 | 0x200  # generators and coroutines (inspect.CO_GENERATOR, ...)


class LeanPasses(PassManager):
    """Numba's pass manager without its bookkeeping."""

    def _runPass(self, index: int, pss: Any, internal_state: Any) -> None:
        pss.analysis = self._analysis
        pss.run_initialization(internal_state)
        changed = pss.run_pass(internal_state)
        pss.run_finalizer(internal_state)
        if changed and isinstance(pss, DeadBranchPrune):
            internal_state.func_ir.blocks = transforms.canonicalize_cfg(internal_state.func_ir.blocks)


class LeanCompiler(Compiler):
    """Numba's compiler with few passes where a function allows it."""

    def define_pipelines(self) -> list[Any]:
        """The passes for this function."""
        code = self.state.func_id.code
        if self.state.func_ir is not None or not is_usual(code):
            return [DefaultPassBuilder.define_nopython_pipeline(self.state)]
        passes = LeanPasses("nopython")
        for step in PASSES:
            passes.add_pass(step, step.__name__)
        passes.finalize()
        return [passes]


def is_usual(code: python_types.CodeType) -> bool:
    """Whether a function holds no function of its own, does not yield and names nothing that needs other passes."""
    return not (
        any(isinstance(constant, python_types.CodeType) for constant in code.co_consts)
        or code.co_flags & UNUSUAL_FLAGS
        or UNUSUAL_NAMES & {*code.co_names, *code.co_freevars}
    )
