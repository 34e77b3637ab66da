"""Kernels that a wheel brings compiled: packed into it when it is built, and laid into numba's cache where it is used.

``make wheel`` compiles all kernels for a fixed set of processor features and packs what numba's cache then holds into
one archive in the package. ``take_kernels`` lays it where numba looks for what was compiled on this machine, once. From
then on numba loads it as its own. Nothing of numba is changed, and what is compiled later is compiled for this machine.

A wheel's kernels are taken only where they would run and are right: this Python, this numba and llvmlite, a processor
with all the features, and source files with the bytes that were compiled. Else there is one sentence, and kernels are
compiled here, as after an installation without any.
"""

import hashlib
import json
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from types import FunctionType
from typing import Any

from wingwatch.operations.faults import say

__all__ = ["ARCHIVE", "MANIFEST", "pack_kernels", "take_kernels", "take_or_say"]

_PACKAGE = Path(__file__).absolute().parents[1]
ARCHIVE = "compiled.zip"
"""Its name in the package."""
MANIFEST = "built.json"
"""In the archive: what the kernels were built with and need."""

_LIBRARIES = ("numba", "llvmlite")
_INDEX = ".nbi"


def pack_kernels(package: Path, archive: Path, cpu: str, features: Sequence[str]) -> None:
    """Pack what numba has compiled of a package, with its cache beside the sources (``__pycache__``).

    Args:
        package: folder of the package.
        archive: the file that is written.
        cpu: LLVM's name of the processor that was compiled for.
        features: by LLVM's names, what a processor must have to run the code.
    """
    files = sorted(p for p in package.rglob("__pycache__/*") if p.suffix in (_INDEX, ".nbc"))
    contents = hashlib.sha256()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as packed:
        for file in files:
            contents.update(file.read_bytes())
            packed.write(file, file.parent.parent.relative_to(package) / file.name)
        built = {
            "python": _python(),
            **{name: version(name) for name in _LIBRARIES},
            "cpu": cpu,
            "features": sorted(features),
            "sources": _digest_of_sources(package),
            "contents": contents.hexdigest(),
        }
        packed.writestr(MANIFEST, json.dumps(built))


def take_kernels(package: Path = _PACKAGE) -> str | None:
    """Lay the kernels that came with a package into numba's cache, if that has not been done.

    Returns:
        None where there are none, where they are there now, and where it was said before why not; else why the kernels
        that came are not used, one sentence without a full stop.
    """
    if not (package / ARCHIVE).is_file():
        return None
    try:
        with zipfile.ZipFile(package / ARCHIVE) as packed:
            why = _take(packed, package)
    except Exception as error:  # whatever it is: without these kernels everything works
        why = " ".join(str(error).split()) or type(error).__name__
    if why is None:
        return None
    return (
        f"the compiled kernels of this installation are not used ({why}); "
        "they are compiled here, which takes minutes, once"
    )


def take_or_say() -> None:
    """Take the kernels of this installation; where they are not used, say why on standard error."""
    if (why := take_kernels()) is not None:
        say(why)


def _take(packed: zipfile.ZipFile, package: Path) -> str | None:
    """The same for an open archive; why it is of no use here."""
    manifest = packed.read(MANIFEST)
    here = _processor()
    about = hashlib.sha256(repr((manifest, here, _python(), [version(n) for n in _LIBRARIES])).encode())
    done = Path(_cache_of(package / "__init__.py").cache_path) / f"wingwatch-{about.hexdigest()[:16]}.taken"
    if done.exists():
        return None
    built = json.loads(manifest)
    why = _unfit(built, here)
    if why is None and built["sources"] != _digest_of_sources(package):
        why = "a source file was changed"
    if why is None and not _lay(packed, package, here):
        why = "they are for another system"
    done.parent.mkdir(parents=True, exist_ok=True)
    done.touch()
    return why


def _unfit(built: dict[str, Any], here: tuple[str, str, str]) -> str | None:
    """Why code that was built so would not run here or not be loaded; None where nothing speaks against it."""
    if built["python"] != _python():
        return f"they are for Python {built['python']}, and this is {_python()}"
    for name in _LIBRARIES:
        if built[name] != version(name):
            return f"they are for {name} {built[name]}, and {name} {version(name)} is installed"
    _, cpu, features = here
    if (cpu, features) == (built["cpu"], ""):  # asked for by NUMBA_CPU_NAME: a name that stands for features
        return None
    missing = set(built["features"]) - {one[1:] for one in features.split(",") if one.startswith("+")}
    return f"this processor has no {', '.join(sorted(missing))}" if missing else None


def _lay(packed: zipfile.ZipFile, package: Path, here: tuple[str, str, str]) -> int:
    """Add the archive's kernels to numba's cache as compiled for the processor ``here``; how many.

    What was compiled here before gives way: it may be of an earlier version with other callees.
    """
    from wingwatch.service.kernel_worker import (
        one_writer,  # it loads every estimator, as the kernels' types do
    )

    laid = 0
    with tempfile.TemporaryDirectory() as folder, one_writer():
        packed.extractall(folder)
        for index in sorted(Path(folder).rglob(f"*{_INDEX}")):
            source = package / index.parent.relative_to(folder) / f"{index.name.split('.')[0]}.py"
            if source.is_file():
                laid += sum(1 for _ in _add(index, source, here))
    return laid


def _add(index: Path, source: Path, here: tuple[str, str, str]) -> Iterator[str]:
    """Add the forms of one kernel; their names in the archive.

    numba reads both indexes itself: it finds nothing in one of another version, or of a source file with other bytes.
    """
    files: Any = import_module("numba.core.caching").IndexDataCacheFile
    cache = _cache_of(source)
    stamp = cache._impl.locator.get_source_stamp()
    cache._impl.locator.ensure_cache_path()
    brought = files(str(index.parent), index.stem, stamp)
    kept = files(cache.cache_path, index.stem, stamp)
    as_numba_has_it: Callable[[Any], bytes] = kept._dump
    kept._dump = lambda data: data if isinstance(data, bytes) else as_numba_has_it(data)
    for (signature, (triple, *_), code), name in brought._load_index().items():
        key = (signature, here, code)
        if triple == here[0]:
            kept.save(key, Path(brought._data_path(name)).read_bytes())
            yield name


def _cache_of(source: Path) -> Any:
    """numba's cache of the functions in a source file: where it lies depends on the file's folder, and on whether that
    can be written."""
    stand_in = FunctionType(_cache_of.__code__.replace(co_filename=str(source)), {})
    return import_module("numba.core.caching").FunctionCache(stand_in)


def _processor() -> tuple[str, str, str]:
    """What numba compiles for: the system, the processor's name, and its features as ``+avx,-sse4a``."""
    target: Any = import_module("numba.core.registry").cpu_target
    triple, cpu, features = target.target_context.codegen().magic_tuple()
    return triple, cpu, features


def _digest_of_sources(package: Path) -> str:
    """Of all source files: numba looks at a kernel's own file alone, and not at those of the kernels that it calls."""
    digest = hashlib.sha256()
    for file in sorted(package.rglob("*.py")):
        digest.update(f"{file.relative_to(package).as_posix()} {file.stat().st_size}\n".encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()


def _python() -> str:
    return f"{sys.version_info[0]}.{sys.version_info[1]}"
