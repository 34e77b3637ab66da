"""A channel map as the text of its file."""

import json

from wingwatch.telemetry.maps import ChannelEntry, ChannelMap

__all__ = ["map_text"]


def map_text(channel_map: ChannelMap, comments: tuple[str, ...] = ()) -> str:
    """TOML that reads back as the same map.

    Args:
        channel_map: the map.
        comments: lines for a person, put first.
    """
    lines = [f"# {line}" for comment in comments for line in comment.splitlines()]
    lines.append("format = 1")
    whole = channel_map.model_dump(exclude_defaults=True, exclude={"format", "rows", "channels"})
    lines += [f"{key} = {_value(value)}" for key, value in whole.items()]
    rows = channel_map.rows.model_dump(exclude_none=True)
    if rows:
        lines += ["", "[rows]", *(f"{key} = {_value(value)}" for key, value in rows.items())]
    lines += [
        "",
        "[channels]",
        *(f"{name} = {_entry(entry)}" for name, entry in channel_map.channels.items()),
    ]
    return "\n".join(lines) + "\n"


def _entry(entry: ChannelEntry) -> str:
    values = entry.model_dump(exclude_defaults=True)
    return "{ " + ", ".join(f"{key} = {_value(value)}" for key, value in values.items()) + " }"


def _value(value: object) -> str:
    # what JSON escapes in a string, TOML's basic strings escape alike
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
