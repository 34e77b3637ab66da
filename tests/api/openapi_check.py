"""Does a JSON value fit a schema of our OpenAPI description? Only the keywords that it uses are known."""

from collections.abc import Mapping
from typing import Any

_TYPES: Mapping[str, tuple[type, ...]] = {
    "object": (dict,),
    "array": (list,),
    "string": (str,),
    "number": (int, float),
    "integer": (int,),
    "boolean": (bool,),
    "null": (type(None),),
}
_IGNORED = {"title", "description", "default", "format", "propertyNames"}
_KNOWN = {"$ref", "type", "required", "properties", "items", "enum", "const", "anyOf", "additionalProperties"}


def misfits(value: Any, schema: Mapping[str, Any], root: Mapping[str, Any], at: str = "$") -> list[str]:
    """Every place where ``value`` breaks ``schema``; a keyword that is not understood is a misfit too."""
    unknown = set(schema) - _KNOWN - _IGNORED
    found = [f"{at}: the check does not know {key}" for key in sorted(unknown)]
    if "$ref" in schema:
        target: Any = root
        for part in schema["$ref"].removeprefix("#/").split("/"):
            target = target[part]
        found += misfits(value, target, root, at)
    if "anyOf" in schema and all(misfits(value, option, root, at) for option in schema["anyOf"]):
        found.append(f"{at}: {value!r} fits no alternative")
    if "enum" in schema and value not in schema["enum"]:
        found.append(f"{at}: {value!r} is not in {schema['enum']}")
    if "const" in schema and value != schema["const"]:
        found.append(f"{at}: {value!r} is not {schema['const']!r}")
    if "type" in schema and not _is(value, schema["type"]):
        return [*found, f"{at}: {value!r} is no {schema['type']}"]
    return found + _inside(value, schema, root, at)


def _is(value: Any, kind: str) -> bool:
    return isinstance(value, _TYPES[kind]) and (kind == "boolean" or not isinstance(value, bool))


def _inside(value: Any, schema: Mapping[str, Any], root: Mapping[str, Any], at: str) -> list[str]:
    found: list[str] = []
    if isinstance(value, list) and "items" in schema:
        for place, item in enumerate(value):
            found += misfits(item, schema["items"], root, f"{at}[{place}]")
    if isinstance(value, dict):
        properties = schema.get("properties", {})
        more = schema.get("additionalProperties", True)
        found += [f"{at}: {key} is missing" for key in schema.get("required", []) if key not in value]
        for key, item in value.items():
            if key in properties:
                found += misfits(item, properties[key], root, f"{at}.{key}")
            elif more is False:
                found.append(f"{at}: {key} is not described")
            elif isinstance(more, dict):
                found += misfits(item, more, root, f"{at}.{key}")
    return found


def answer_schema(root: Mapping[str, Any], path: str, method: str = "get") -> Mapping[str, Any]:
    """The schema of an operation's JSON answer."""
    content = root["paths"][path][method]["responses"]["200"]["content"]
    schema: Mapping[str, Any] = content["application/json"]["schema"]
    return schema
