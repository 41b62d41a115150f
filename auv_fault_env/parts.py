"""Compiled functions of which others make a part of themselves.

Numba compiles each function that a kernel calls as if Python called it too: it optimises it, makes
machine code and wrappers of it, and then the kernel inlines it and optimises it once more, level
after level. Here a function that another one calls is translated alone, and all that a kernel
consists of is optimised once, with the kernel. What Python calls is compiled as numba does.
"""

import gc
from collections.abc import Iterator
from contextlib import contextmanager

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering
from numba.core.types import unliteral


class PartLibrary(JITCodeLibrary):
    """The code of a part, as it was translated."""

    def _optimize_final_module(self):
        """Leave it as it is."""

    def _finalize_final_module(self):
        """Make no machine code."""
        self._finalize_dynamic_globals()
        self._finalized = True


@register_pass(mutates_CFG=True, analysis_only=False)
class PartLowering(NativeLowering):
    """Translates a part, without wrappers for calls from Python and C."""

    _name = "part_lowering"

    def run_pass(self, state):
        """Translate; the entry point is none, but unlike those of other parts."""
        state.library = PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        flags = state.flags.copy()
        flags.no_compile = True
        flags.no_cpython_wrapper = True
        flags.no_cfunc_wrapper = True
        state.flags = flags
        super().run_pass(state)
        state.library.finalize()
        entry = object()
        lowered = state["cr"]._replace(cfunc=entry)
        state["cr"] = lowered
        state.targetctx.insert_user_function(entry, lowered.fndesc, [state.library])
        return True


class PartCompiler(CompilerBase):
    """Numba's compiler with `PartLowering`."""

    def define_pipelines(self):
        """Its only pipeline."""
        usual = DefaultPassBuilder.define_nopython_pipeline(self.state)
        pipeline = PassManager("part")
        for one, description in usual.passes:
            pipeline.add_pass(PartLowering if one is NativeLowering else one, description)
        pipeline.finalize()
        return [pipeline]


class Part(CPUDispatcher):
    """A function as a part of others; Python cannot call it."""

    def add_overload(self, compiled):
        """Keep what was translated, for others alone."""
        self.overloads[tuple(compiled.signature.args)] = compiled


@contextmanager
def collector_paused() -> Iterator[None]:
    """Without the collector of cyclic garbage, which compiling would start all the time."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


class CompiledFunction(CPUDispatcher):
    """A function that Python calls as it is, and that compiled functions make a part of them."""

    # as numba calls it to read a pickled one
    def __init__(self, function, locals=None, targetoptions=None):
        super().__init__(function, locals, targetoptions)
        self.part = Part(function, locals, targetoptions, PartCompiler)

    def compile(self, sig):
        """Compile for these types, with the collector of garbage paused."""
        with collector_paused():
            return super().compile(sig)

    def get_call_template(self, args, kws):
        """What a compiled function calls, by the types of the arguments.

        A number that is written down is not a type of its own.
        """
        args = tuple(map(unliteral, args))
        kws = {name: unliteral(one) for name, one in kws.items()}
        return self.part.get_call_template(args, kws)

    def get_overload(self, signature):
        """The entry point of what a compiled function calls."""
        return self.part.get_overload(signature)
