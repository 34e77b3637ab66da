"""Reading aircraft files, by path or by name from the library, with errors that teach."""

import tomllib
import types
import typing
from importlib.resources import files
from pathlib import Path

from pydantic import BaseModel, ValidationError

from wingwatch.aircraft.aircraft_file import Aircraft

__all__ = ["AircraftFileError", "library_names", "load_aircraft"]

_MAX_FILE_BYTES = 1_000_000


class AircraftFileError(ValueError):
    """An aircraft file that cannot be used: one sentence with file, key, value and what is allowed."""


def library_names() -> tuple[str, ...]:
    """Names of the aircraft that come with wingwatch, in alphabetical order."""
    folder = files("wingwatch.aircraft") / "library"
    return tuple(sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")))


def load_aircraft(name_or_path: str | Path) -> Aircraft:
    """An aircraft of the library by name, or from a file.

    A ``Path``, or a text that ends in ``.toml`` or holds a slash, is a file; any other text is a library
    name.

    Raises:
        AircraftFileError: no such aircraft or file, or a file that is not a valid aircraft file.
    """
    text = str(name_or_path)
    is_path = isinstance(name_or_path, Path) or text.endswith(".toml") or "/" in text or "\\" in text
    if is_path:
        return _read(Path(name_or_path), text)
    if text not in library_names():
        raise AircraftFileError(
            f"aircraft {text!r} is not in the library, which has {', '.join(library_names())}; "
            "name one of these or give the path of an aircraft file"
        )
    return parse_aircraft((files("wingwatch.aircraft") / "library" / f"{text}.toml").read_bytes(), text)


def _read(path: Path, shown: str) -> Aircraft:
    try:
        with path.open("rb") as stream:
            raw = stream.read(_MAX_FILE_BYTES + 1)
    except FileNotFoundError:
        raise AircraftFileError(
            f"aircraft file {shown} does not exist; give an existing file or one of the library: "
            f"{', '.join(library_names())}"
        ) from None
    except OSError as error:
        raise AircraftFileError(f"aircraft file {shown} cannot be read: {error.strerror}") from None
    if len(raw) > _MAX_FILE_BYTES:
        raise AircraftFileError(
            f"aircraft file {shown} is larger than the allowed {_MAX_FILE_BYTES} bytes; shorten it"
        )
    return parse_aircraft(raw, shown)


def parse_aircraft(raw: bytes, shown: str) -> Aircraft:
    """An aircraft from a file's content; ``shown`` names the file in errors.

    Raises:
        AircraftFileError: not UTF-8, not TOML, or not what an aircraft file allows.
    """
    try:
        content = tomllib.loads(raw.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise AircraftFileError(
            f"aircraft file {shown} is not UTF-8 text (byte {error.start}); save it as UTF-8"
        ) from None
    except tomllib.TOMLDecodeError as error:
        raise AircraftFileError(f"aircraft file {shown} is not valid TOML: {error}") from None
    try:
        return Aircraft.model_validate(content)
    except ValidationError as error:
        raise AircraftFileError(_sentence(error, shown)) from None


def _sentence(error: ValidationError, shown: str) -> str:
    problems = error.errors(include_url=False)
    first = problems[0]
    loc = first["loc"]
    key = ".".join(str(part) for part in loc) or "the top level"
    value = first["input"]
    kind = first["type"]
    if kind == "extra_forbidden":
        allowed = _keys_at(loc[:-1])
        text = f"{key} = {_short(value)} is a key that is not known; allowed there are {', '.join(allowed)}"
    elif kind == "missing":
        text = f"{key} is missing; it is required"
    elif kind == "value_error":
        text = f"{key}: {first['ctx']['error']}"
    else:
        message = first["msg"].removeprefix("Input should be ").removeprefix("a ")
        text = f"{key} is {_short(value)}; allowed is {message[0].lower()}{message[1:]}"
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return f"aircraft file {shown}: {text}{more}"


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _keys_at(loc: tuple[int | str, ...]) -> list[str]:
    """Keys that the model at a location of the file allows."""
    here: object = Aircraft
    for part in loc:
        if isinstance(part, int):
            here = _inner(here, last=False)
            continue
        model = _model(here)
        here = model.model_fields[part].annotation if model else _inner(here, last=True)
    model = _model(here)
    return list(model.model_fields) if model else []


def _model(annotation: object) -> type[BaseModel] | None:
    """The model that an annotation names, alone or as ``Model | None``."""
    alternatives = typing.get_args(annotation) if typing.get_origin(annotation) is types.UnionType else ()
    for candidate in (annotation, *alternatives):
        if isinstance(candidate, type) and issubclass(candidate, BaseModel):
            return candidate
    return None


def _inner(annotation: object, last: bool) -> object:
    """Element type of ``tuple[X, ...]`` (first argument) or of ``dict[str, X]`` (last)."""
    arguments = typing.get_args(annotation)
    if not arguments:
        return annotation
    return arguments[-1] if last else arguments[0]
