"""Writing aircraft files: TOML that reads back to the same aircraft."""

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

from wingwatch.aircraft.aircraft_file import Aircraft

__all__ = ["aircraft_toml"]

_LONGEST_INLINE = 110
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_UNPRINTABLE = re.compile(r"[^\S ]|[\x00-\x1f\x7f\ud800-\udfff]")

_Table = Mapping[str, Any]


def aircraft_toml(aircraft: Aircraft, comment: str = "") -> str:
    """The text of an aircraft file; ``load_aircraft`` gives the same aircraft back.

    Args:
        aircraft: what is written, defaults included.
        comment: lines put at the head of the file, each behind ``#``.
    """
    lines = [f"# {_UNPRINTABLE.sub(' ', line)}".rstrip() for line in comment.split("\n") if comment]
    content = aircraft.model_dump(mode="json", exclude_none=True)
    return "\n".join([*lines, *_body(content, ())]).strip() + "\n"


def _body(table: _Table, path: tuple[str, ...]) -> Iterator[str]:
    """The lines of a table: values first, since a header ends what belongs to the table before it."""
    headed = {key: value for key, value in table.items() if _needs_header(key, value, bool(path))}
    for key, value in table.items():
        if key not in headed and value != {}:
            yield f"{_key(key)} = {_value(value, multiline=not path)}"
    for key, value in headed.items():
        inner = (*path, key)
        name = ".".join(_key(part) for part in inner)
        for entry in value if isinstance(value, list) else [value]:
            yield ""
            yield f"[[{name}]]" if isinstance(value, list) else f"[{name}]"
            yield from _body(entry, inner)


def _needs_header(key: str, value: object, inside: bool) -> bool:
    """Tables of tables, lists of tables, and tables that are too long for one line."""
    if isinstance(value, list):
        return bool(value) and isinstance(value[0], dict)
    if not isinstance(value, dict) or not value:
        return False
    nested = any(isinstance(v, dict | list) and not _plain_list(v) for v in value.values())
    return not inside or nested or len(f"{key} = {_value(value)}") > _LONGEST_INLINE


def _plain_list(value: object) -> bool:
    return isinstance(value, list) and not any(isinstance(v, dict | list) for v in value)


def _key(key: str) -> str:
    return key if _BARE_KEY.fullmatch(key) else _text(key)


def _value(value: object, multiline: bool = False) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return repr(value)
    if isinstance(value, float):
        return repr(float(value))  # the shortest text that reads back to the same bits, of numpy's floats too
    if isinstance(value, str):
        return _long_text(value) if multiline and "\n" in value else _text(value)
    if isinstance(value, list):
        return f"[{', '.join(_value(v) for v in value)}]"
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{_key(k)} = {_value(v)}' for k, v in value.items())} }}"
    raise TypeError(f"a {type(value).__name__} has no form in TOML")


def _text(text: str) -> str:
    """A basic string: TOML's escapes are JSON's, and DEL must be one too."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _long_text(text: str) -> str:
    lines = [_text(line)[1:-1] for line in text.split("\n")]
    return '"""\n' + "\n".join(lines) + '"""'
