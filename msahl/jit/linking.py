"""Compiles functions that only kernels call together with the function that Python calls.

numba would optimise each of them with all that it calls, and generate machine code that is never
run, once more for every level of calls; that took a third of the compile time. Here they are
optimised and turned into machine code once, as part of the function that is entered from Python.
"""

from typing import Any

from llvmlite.binding import Linkage
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import LoweringPass, PassManager, register_pass
from numba.core.typed_passes import NativeLowering


class _Library(JITCodeLibrary):
    """Code that is only linked into that of its callers: not optimised and not finalised alone."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


class _Register(LoweringPass):
    """Register a lowered function for its callers, by a unique name instead of an address."""

    _name = "register_callable"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        unique = list[Any]().append  # numba needs a builtin; this one equals no other
        state.targetctx.insert_user_function(unique, state.cr.fndesc, [state.library])
        state.cr = state.cr._replace(cfunc=unique)
        return True


@register_pass(mutates_CFG=False, analysis_only=False)
class _RegisterApart(_Register):
    pass


@register_pass(mutates_CFG=False, analysis_only=False)
class _RegisterInlined(_Register):
    def run_pass(self, state: Any) -> bool:
        # numba's own flag would also apply to all functions that this one calls, however large.
        function = state.library.get_function(state.cr.fndesc.mangled_name)
        function.add_function_attribute("alwaysinline")
        return super().run_pass(state)


class Apart(CompilerBase):
    """Compiler of functions that LLVM may or may not inline."""

    register: type[_Register] = _RegisterApart

    def define_pipelines(self) -> list[PassManager]:
        """Return numba's own pipeline with another last pass."""
        self.state.flags.no_compile = True
        name = self.state.func_id.func_qualname
        self.state.library = _Library(self.state.targetctx.codegen(), name)
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(self.register, NativeLowering)
        passes.finalize()
        return [passes]


class Inlined(Apart):
    """Compiler of functions that are always inlined."""

    register = _RegisterInlined


class _EntryLibrary(JITCodeLibrary):
    """Code of a function that Python calls, with all that it calls."""

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if function.linkage == Linkage.linkonce_odr:
                # Nothing outside calls it; so LLVM may inline it if it has only one caller.
                function.linkage = "internal"
        super()._optimize_final_module()


class Entered(CompilerBase):
    """Compiler of functions that Python calls."""

    def define_pipelines(self) -> list[PassManager]:
        """Return numba's own pipeline."""
        name = self.state.func_id.func_qualname
        self.state.library = _EntryLibrary(self.state.targetctx.codegen(), name)
        self.state.library.enable_object_caching()
        return [DefaultPassBuilder.define_nopython_pipeline(self.state)]
