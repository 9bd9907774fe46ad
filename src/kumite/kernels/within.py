"""Kernels that are called by kernels and, now and then, from Python: each way is compiled by need.

Numba makes of every function, for every signature, machine code, a wrapper for Python and one for
C. A kernel that only other kernels call needs none of them: its intermediate code is linked into
theirs. For small functions of many arrays that is a third of the time that compiling takes.

What is used of Numba here is not public: pyproject.toml allows the one version it was tried with.
"""

# pyright: reportAttributeAccessIssue=false, reportArgumentType=false

from __future__ import annotations

from typing import Any

from numba.core import compiler, event, sigutils
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import _FunctionCompiler
from numba.core.registry import CPUDispatcher, cpu_target

KERNELS: dict[str, Kernel] = {}
"""All kernels made so far, by module and name."""

_HASH = hash(compiler.Flags())  # of the options' names: the same for all


class _Flags(compiler.Flags):
    """Numba's, compared quickly: they are part of the key under which it looks types up."""

    __slots__ = ()

    def __hash__(self) -> int:
        return _HASH

    def __eq__(self, other: object) -> bool:
        if self is other or self._values == getattr(other, "_values", None):
            return True
        return super().__eq__(other)


class _LinkedCode(JITCodeLibrary):
    """Code that is linked into that of its callers, of which no machine code is made."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


class _Compiler(_FunctionCompiler):
    linked = False

    def _compile_core(self, args: Any, return_type: Any) -> Any:
        flags = _Flags()
        self.targetdescr.options.parse_as_flags(flags, self.targetoptions)
        context, library = self.targetdescr.target_context, None
        if self.linked:
            flags.no_compile = True
            library = _LinkedCode(context.codegen(), self.py_func.__qualname__)
        result = compiler.compile_extra(
            self.targetdescr.typing_context,
            context,
            self.py_func,
            args=args,
            return_type=return_type,
            flags=flags,
            locals=self.locals,
            library=library,
            pipeline_class=self.pipeline_class,
        )
        if result.typing_error is not None:
            raise result.typing_error
        if self.linked:
            key = object()  # callers find it by this: there is no address
            context.insert_user_function(key, result.fndesc, [result.library])
            result = result._replace(entry_point=key)
        return result


class _Linked(CPUDispatcher):
    """A kernel as other kernels call it. Kept in no file: that of its callers holds its code."""

    def __init__(self, function: Any, options: dict[str, Any]) -> None:
        super().__init__(function, targetoptions={**options, "no_cpython_wrapper": True})
        self._compiler = _compiler(self)
        self._compiler.linked = True

    def compile(self, sig: Any) -> Any:
        args, return_type = sigutils.normalize_signature(sig)
        found = self.overloads.get(tuple(args))
        if found is None:
            details = {"dispatcher": self, "args": args, "return_type": return_type}
            with (
                global_compiler_lock,
                self._compiling_counter,
                event.trigger_event("numba:compile", data=details),
            ):
                found = self._compiler.compile(args, return_type)
                self.overloads[tuple(found.signature.args)] = found
        return found.entry_point


def _compiler(dispatcher: CPUDispatcher) -> _Compiler:
    options, fixed = dispatcher.targetoptions, dispatcher.locals
    return _Compiler(dispatcher.py_func, cpu_target, options, fixed, compiler.Compiler)


class Kernel(CPUDispatcher):
    """A compiled function, with machine code of its own as soon as Python calls it."""

    def __init__(self, function: Any, **options: Any) -> None:
        options = {"nopython": True, "boundscheck": None, "no_cfunc_wrapper": True, **options}
        super().__init__(function, targetoptions=options)
        self._compiler = _compiler(self)
        self.linked = _Linked(function, options)
        KERNELS[f"{function.__module__}.{function.__qualname__}"] = self

    def get_call_template(self, args: Any, kws: Any) -> Any:
        return self.linked.get_call_template(args, kws)

    def get_overload(self, sig: Any) -> Any:
        return self.linked.get_overload(sig)

    def is_kept(self, args: tuple[Any, ...]) -> bool:
        """Whether code for arguments of these Numba types lies in the cache, for these sources."""
        key = self._cache._index_key(args, self.targetctx.codegen())
        return args in self.overloads or self._cache._cache_file.holds(key)
