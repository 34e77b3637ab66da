"""Answers of the door whose content is JSON."""

from typing import Any

from fastapi import Response
from pydantic import BaseModel

from wingwatch.api.encoding import encode_json

__all__ = ["JsonResponse", "json_answer"]


class JsonResponse(Response):
    """An answer whose content is encoded by ``encode_json``."""

    media_type = "application/json"

    def render(self, content: Any) -> bytes:
        """The body's bytes."""
        return encode_json(content)


def json_answer(model: BaseModel) -> Response:
    """A validated model as an answer that no cache keeps."""
    return JsonResponse(model.model_dump(), headers={"Cache-Control": "no-store"})
