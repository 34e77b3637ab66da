"""Kernels that kernels alone call are turned into code once, in those that Python calls.

numba makes a library of every compiled function: optimised, with all in it that the function calls, and emitted as
machine code. A kernel four calls below the one that Python calls is so optimised and emitted five times. A piece is
not: its code, as the compiler's front end wrote it, is linked into the kernels that call it.

``PieceCompiler`` is a pipeline as numba's manual describes them. That its library does not optimise what others link is
no documented interface of numba: ``tests/estimators/test_estimators_pieces.py`` fails where another version of numba
does it in another way. Without that library every kernel works as before, and is compiled more often.
"""

from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.typed_passes import AnnotateTypes

__all__ = ["PieceCompiler"]


class _Piece(JITCodeLibrary):
    """Code for other libraries to link: neither optimised as a whole nor emitted."""

    def finalize(self) -> None:
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Zero: there is no machine code."""
        return 0

    @property
    def codegen(self) -> Any:
        return _WithoutEnvironment(self._codegen)


class _WithoutEnvironment:
    """A code generator to which a function's environment, which kernels do not use, is not handed: it has no place in
    code that is not emitted."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, name: str, environment: Any) -> None:
        """Nothing is set."""


@register_pass(mutates_CFG=False, analysis_only=True)
class _ChooseLibrary(AnalysisPass):
    """Before code is written: that it goes into a piece."""

    _name = "wingwatch_choose_library"

    def __init__(self) -> None:
        AnalysisPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        state.library = _Piece(state.targetctx.codegen(), state.func_id.func_qualname)
        return False


class PieceCompiler(CompilerBase):
    """The pipeline of a piece: numba's own, and a library of the other kind."""

    def define_pipelines(self) -> list[Any]:
        """numba asks for them."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_ChooseLibrary, AnnotateTypes)
        passes.finalize()
        return [passes]
