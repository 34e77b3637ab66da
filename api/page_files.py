"""The page's files, served as they lie in the package, and the libraries that it takes from installed packages."""

import gzip
import hashlib
from collections.abc import Callable
from functools import cache, lru_cache, partial
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

from fastapi import APIRouter, Request, Response

from wingwatch.api.guards import CONTENT_SECURITY_POLICY

__all__ = ["VIEW_PATHS", "pages_router"]

VIEW_PATHS = ("/", "/vehicles/{vehicle}", "/alerts", "/diagnoses", "/studies")
"""Paths of the page's views: each is answered with the same shell, and the browser shows the view."""

_DOCS_POLICY = CONTENT_SECURITY_POLICY.replace("img-src 'self'", "img-src 'self' data:")
"""Swagger UI's style sheet has its small pictures inside."""

_FOLDER = Path(__file__).parent / "pages"
_MEDIA_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}


def pages_router() -> APIRouter:
    """The page's views, the description of REST at ``/docs``, and the files that they need.

    Files are read and compressed once, and revalidated by ETag, so that a new version of the service is seen at once.
    """
    router = APIRouter(include_in_schema=False)
    for path in sorted(_FOLDER.rglob("*")):
        if path.suffix in _MEDIA_TYPES and path.suffix != ".html":
            _add(router, f"/pages/{path.relative_to(_FOLDER).as_posix()}", path.read_bytes, path.suffix)
    for view in VIEW_PATHS:
        _add(router, view, (_FOLDER / "index.html").read_bytes, ".html")
    _add(router, "/docs", (_FOLDER / "docs.html").read_bytes, ".html", _DOCS_POLICY)
    _add(router, "/pages/plotly.js", (files("plotly") / "package_data" / "plotly.min.js").read_bytes, ".js")
    for name in ("swagger-ui.css", "swagger-ui-bundle.js"):
        read = partial(_swagger_file, name)
        _add(router, f"/pages/{name.replace('-bundle', '')}", read, Path(name).suffix)
    return router


def _swagger_file(name: str) -> bytes:
    """A file of Swagger UI, of the one version that the installed package has."""
    (folder,) = (files("swagger_ui_bundle") / "vendor").iterdir()
    return (folder / name).read_bytes()


class _Form(NamedTuple):
    """A file as it is sent: plain, or compressed for who takes that."""

    body: bytes
    tag: str
    headers: dict[str, str]


@lru_cache(maxsize=128)
def _forms(body: bytes) -> tuple[_Form, _Form]:
    """A file plain and with gzip, each under a tag of its own; kept, for a process may have several applications."""
    tag = hashlib.sha256(body).hexdigest()[:16]
    small = gzip.compress(body, mtime=0)
    return _Form(body, f'"{tag}"', {}), _Form(small, f'"{tag}-gzip"', {"Content-Encoding": "gzip"})


def _takes_gzip(accepted: str) -> bool:
    """Whether a header Accept-Encoding takes gzip (RFC 9110, section 12.5.3)."""
    for one in accepted.lower().split(","):
        name, _, weight = one.partition(";")
        if name.strip() in ("gzip", "*"):
            return weight.replace(" ", "") not in ("q=0", "q=0.0", "q=0.00", "q=0.000")
    return False


def _add(
    router: APIRouter, path: str, read: Callable[[], bytes], suffix: str, policy: str | None = None
) -> None:
    @cache
    def whole() -> tuple[_Form, _Form]:
        return _forms(read())

    def page(request: Request) -> Response:
        body, tag, more = whole()[_takes_gzip(request.headers.get("accept-encoding", ""))]
        headers = {"ETag": tag, "Cache-Control": "no-cache", "Vary": "Accept-Encoding"}
        if policy is not None:
            headers["Content-Security-Policy"] = policy
        if request.headers.get("if-none-match") == tag:
            return Response(status_code=304, headers=headers)
        return Response(body, media_type=_MEDIA_TYPES[suffix], headers={**headers, **more})

    router.add_api_route(path, page, methods=["GET"])
