"""Compilers of functions that are only called by other kernels, never from Python.

numba would optimise each of them, with all that it calls, and make machine code of it that nobody
runs: once more for every level of calls, which took a third of the time of compiling. Here they are
optimised and made machine code with the function that is entered.
"""

from typing import Any

from llvmlite.binding import Linkage
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import LoweringPass, PassManager, register_pass
from numba.core.typed_passes import NativeLowering


class _Library(JITCodeLibrary):
    """Code to be linked into that of callers."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


class _Offer(LoweringPass):
    """Make a lowered function known to callers, by a name of its own in place of an address."""

    _name = "offer"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        unique = list[Any]().append  # numba wants a builtin; this one is equal to no other
        state.targetctx.insert_user_function(unique, state.cr.fndesc, [state.library])
        state.cr = state.cr._replace(cfunc=unique)
        return True


@register_pass(mutates_CFG=False, analysis_only=False)
class _OfferApart(_Offer):
    pass


@register_pass(mutates_CFG=False, analysis_only=False)
class _OfferInlined(_Offer):
    def run_pass(self, state: Any) -> bool:
        # numba's own flag for it is handed on to all that the function calls, however large.
        function = state.library.get_function(state.cr.fndesc.mangled_name)
        function.add_function_attribute("alwaysinline")
        return super().run_pass(state)


class Apart(CompilerBase):
    """Of functions of which the compiler decides whether they become part of their callers."""

    offer: type[_Offer] = _OfferApart

    def define_pipelines(self) -> list[PassManager]:
        """numba's own pipeline, but for its end."""
        self.state.flags.no_compile = True
        name = self.state.func_id.func_qualname
        self.state.library = _Library(self.state.targetctx.codegen(), name)
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(self.offer, NativeLowering)
        passes.finalize()
        return [passes]


class Inlined(Apart):
    """Of functions that do become part of their callers."""

    offer = _OfferInlined


class _EnteredLibrary(JITCodeLibrary):
    """Code that is entered from Python, with all that it calls."""

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if function.linkage == Linkage.linkonce_odr:
                # Nobody else calls it: with but one caller it may as well become part of that.
                function.linkage = "internal"
        super()._optimize_final_module()


class Entered(CompilerBase):
    """Of functions that are entered from Python."""

    def define_pipelines(self) -> list[PassManager]:
        """numba's own pipeline."""
        name = self.state.func_id.func_qualname
        self.state.library = _EnteredLibrary(self.state.targetctx.codegen(), name)
        self.state.library.enable_object_caching()
        return [DefaultPassBuilder.define_nopython_pipeline(self.state)]
