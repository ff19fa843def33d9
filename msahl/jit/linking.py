"""Compiles single functions to LLVM's intermediate code, and links them to object files.

numba would link each function with all that it calls, optimise it and generate machine code, once
more for every level of calls. Here a function is translated once, without what it calls, and
optimised and turned into machine code only as part of an entry or unit.
"""

from typing import Any

from llvmlite import binding as llvm
from llvmlite.binding import Linkage
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import LoweringPass, PassManager, register_pass
from numba.core.typed_passes import NativeLowering


class Library(JITCodeLibrary):
    """Code that is linked only: neither optimised as a whole nor turned into machine code."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True

    def emit_bitcode(self, name: str, symbol: str, inline: bool) -> bytes:
        """Return the code with its function ``name`` as ``symbol``; all else is internal."""
        module = self._final_module
        module.get_function(name).name = symbol
        for part in (*module.functions, *module.global_variables):
            # Names of numba's are unique in one process only, and files come from several.
            if not part.is_declaration and part.name != symbol:
                part.linkage = "internal"
        if inline:
            module.get_function(symbol).add_function_attribute("alwaysinline")
        code: bytes = module.as_bitcode()
        return code


@register_pass(mutates_CFG=False, analysis_only=False)
class _Register(LoweringPass):
    """Register a lowered function for its callers, by a unique name instead of an address."""

    _name = "register_callable"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        unique = list[Any]().append  # numba needs a builtin; this one equals no other
        function = state.library.get_function(state.cr.fndesc.mangled_name)
        function.add_function_attribute("alwaysinline")
        state.targetctx.insert_user_function(unique, state.cr.fndesc, [state.library])
        state.cr = state.cr._replace(cfunc=unique)
        return True


class Separate(CompilerBase):
    """Compiler of one function without those that it calls."""

    def define_pipelines(self) -> list[PassManager]:
        """Return numba's own pipeline."""
        self.state.flags.no_compile = True
        name = self.state.func_id.func_qualname
        self.state.library = Library(self.state.targetctx.codegen(), name)
        return [DefaultPassBuilder.define_nopython_pipeline(self.state)]


class Included(CompilerBase):
    """Compiler of functions that are part of each function that calls them, and inlined."""

    def define_pipelines(self) -> list[PassManager]:
        """Return numba's own pipeline with another last pass."""
        (passes,) = Separate.define_pipelines(self)  # type: ignore[arg-type]
        passes.add_pass_after(_Register, NativeLowering)
        passes.finalize()
        return [passes]


class ObjectLibrary(JITCodeLibrary):
    """Code of a function with all that it calls, to be written to an object file.

    ``exported`` holds the names under which others find its functions.
    """

    exported: tuple[str, ...]

    def add_bitcode(self, code: bytes) -> None:
        """Link the code of a function."""
        self._final_module.link_in(llvm.parse_bitcode(code))

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.name not in self.exported:
                # Nothing outside calls it; so LLVM may inline it if it has only one caller.
                function.linkage = Linkage.internal
        super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        self._finalized = True

    def emit_object(self) -> bytes:
        """Return the machine code as an object file."""
        code: bytes = self._codegen._tm.emit_object(self._final_module)
        return code
