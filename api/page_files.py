"""The status page's files, served as they lie in the package."""

import hashlib
from collections.abc import Mapping
from pathlib import Path

from fastapi import APIRouter, Request, Response

__all__ = ["pages_router"]

_FOLDER = Path(__file__).parent / "pages"
_FILES: Mapping[str, tuple[str, str]] = {
    "/": ("index.html", "text/html; charset=utf-8"),
    "/pages/app.css": ("app.css", "text/css; charset=utf-8"),
    "/pages/app.js": ("app.js", "text/javascript; charset=utf-8"),
    "/pages/icon.svg": ("icon.svg", "image/svg+xml"),
}


def pages_router() -> APIRouter:
    """The page at ``/`` and the three files that it needs; read once, revalidated by ETag."""
    router = APIRouter(include_in_schema=False)
    for path, (name, media_type) in _FILES.items():
        _add(router, path, (_FOLDER / name).read_bytes(), media_type)
    return router


def _add(router: APIRouter, path: str, body: bytes, media_type: str) -> None:
    tag = f'"{hashlib.sha256(body).hexdigest()[:16]}"'
    headers = {"ETag": tag, "Cache-Control": "no-cache"}

    async def page(request: Request) -> Response:
        if request.headers.get("if-none-match") == tag:
            return Response(status_code=304, headers=headers)
        return Response(body, media_type=media_type, headers=headers)

    router.add_api_route(path, page, methods=["GET"])
