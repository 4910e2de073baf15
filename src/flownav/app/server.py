"""The page's server: its routes, and its run on a socket of this machine alone."""

import json
import secrets
import socket
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flownav.app import uploads
from flownav.app.desk import Desk
from flownav.app.doors import NAMES, WRITTEN_POLICY, Doors
from flownav.app.requirements import kept_requirement
from flownav.app.sessions import sessions_in
from flownav.app.shelf import Shelf
from flownav.app.tasks import command_line, flight_words, task_of
from flownav.core.errors import InputError, arg

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.responses import Response

NEEDED = "flownav app needs the packages starlette and uvicorn: pip install 'flownav[app]'"
STATIC = Path(__file__).parent / "static"
REPORT = Path(__file__).parents[1] / "report"
STYLES = {"landing.css": REPORT / "landing.css", "picture.css": REPORT / "picture.css"}
TOKEN_BYTES = 24
MOST_JSON_BYTES = 1 << 20
KINDS = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}

Handler = Callable[["Request"], Awaitable["Response"]]


def application(desk: Desk) -> Any:
    """The routes of the page; who may come in is for `Doors` to say. InputError where Starlette is missing."""
    try:
        from starlette.applications import Starlette
        from starlette.routing import Route
    except ImportError:
        raise InputError(NEEDED) from None

    @asynccontextmanager
    async def lifespan(app: Any) -> AsyncIterator[None]:
        yield
        await desk.close()

    routes = [
        Route("/", _page),
        Route("/static/{name}", _static),
        Route("/files/{name:path}", _of(desk, _file)),
        Route("/api/state", _of(desk, _state)),
        Route("/api/live", _of(desk, _live)),
        Route("/api/upload", _of(desk, _upload), methods=["PUT"]),
        Route("/api/folder", _of(desk, _folder), methods=["POST"]),
        Route("/api/remove", _of(desk, _remove), methods=["POST"]),
        Route("/api/look", _of(desk, _look), methods=["POST"]),
        Route("/api/ask", _of(desk, _ask), methods=["POST"]),
        Route("/api/requirement", _of(desk, _requirement), methods=["POST"]),
        Route("/api/jobs", _of(desk, _start), methods=["POST"]),
        Route("/api/jobs/{number:int}", _of(desk, _cancel), methods=["DELETE"]),
    ]
    return Starlette(routes=routes, lifespan=lifespan)


def listening(port: int) -> socket.socket:
    """A socket of this machine alone. port: 0 for a free one. InputError where the port is taken."""
    found = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        found.bind((NAMES[0], port))
    except OSError as error:
        found.close()
        raise InputError(f"{arg('port')} {port}: cannot be used ({error.strerror}); give another") from error
    return found


def serve(folder: Path, port: int, worker: Sequence[str], begun: Callable[[str], None]) -> None:
    """Serve the page until it is ended by Ctrl-C.

    folder: its files, made if it is not there. port: 0 for a free one. worker: how a warm process is called. begun:
    called with the page's address when it listens. InputError where a package is missing, or folder or port cannot be.
    """
    try:
        import uvicorn
    except ImportError:
        raise InputError(NEEDED) from None
    inside, token = application(Desk(Shelf(folder), worker)), secrets.token_urlsafe(TOKEN_BYTES)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{arg('folder')} {folder}: cannot be made ({error.strerror}); give another") from error
    with listening(port) as found:
        number = found.getsockname()[1]
        config = uvicorn.Config(Doors(inside, token, number), log_level="warning", access_log=False, loop="asyncio",
                                http="h11", ws="none", lifespan="on", timeout_graceful_shutdown=5)  # fmt: skip
        found.listen()
        begun(f"http://{NAMES[0]}:{number}/{token}/")
        uvicorn.Server(config).run(sockets=[found])


# -- the routes ----------------------------------------------------------------------------------------------------
def _of(desk: Desk, answer: Callable[[Desk, "Request"], Awaitable["Response"]]) -> Handler:
    """A route on the desk; a mistake is one line, with status 400."""

    async def handler(request: "Request") -> "Response":
        from starlette.requests import ClientDisconnect
        from starlette.responses import JSONResponse, Response

        try:
            return await answer(desk, request)
        except InputError as error:
            return JSONResponse({"error": str(error)}, 400)
        except OSError as error:
            return JSONResponse({"error": f"{error.filename or 'a file'}: {error.strerror or error}"}, 400)
        except ClientDisconnect:
            return Response(status_code=400)

    return handler


async def _asked(request: "Request") -> dict[str, Any]:
    """The object that a request brings. InputError where it is none."""
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > MOST_JSON_BYTES:
            raise InputError("this asks for too much at once")
    try:
        found = json.loads(body)
    except ValueError:
        found = None
    if not isinstance(found, dict):
        raise InputError("an object is needed")
    return found


def _json(found: Any) -> "Response":
    from starlette.responses import JSONResponse

    return JSONResponse(found)


async def _page(request: "Request") -> "Response":
    return _plain_file(STATIC / "index.html")


async def _static(request: "Request") -> "Response":
    """A module, a style, or the palette, which is the reports' own."""
    from starlette.responses import Response

    name = request.path_params["name"]
    if name == "palette.css":
        return Response(palette(), media_type="text/css")
    path = STYLES.get(name, STATIC / name)
    known = path.suffix in KINDS and path.is_file() and path.parent in (STATIC, REPORT)
    return _plain_file(path) if known else Response(status_code=404)


def _plain_file(path: Path) -> "Response":
    from starlette.responses import Response

    return Response(path.read_bytes(), media_type=KINDS[path.suffix])


def palette() -> str:
    """The colours of the reports as variables, on light and on dark."""
    from flownav.report.style import FONT, PALETTE

    light, dark = (";".join(f"--{role}:{colours[k]}" for role, colours in PALETTE.items()) for k in (0, 1))
    return (
        f":root{{{light};--font:{FONT};color-scheme:light dark}}@media(prefers-color-scheme:dark){{:root{{{dark}}}}}\n"
    )


async def _file(desk: Desk, request: "Request") -> "Response":
    """A file of the folder: a page in its sandbox, anything else to be saved."""
    from starlette.responses import FileResponse

    path = desk.shelf.existing(request.path_params["name"])
    if not path.is_file():
        raise InputError(f"{path.name}: is a folder")
    if path.suffix == ".html":
        return FileResponse(path, headers={"content-security-policy": WRITTEN_POLICY})
    return FileResponse(path, filename=path.name, media_type="application/octet-stream")


async def _state(desk: Desk, request: "Request") -> "Response":
    return _json(desk.state())


async def _live(desk: Desk, request: "Request") -> "Response":
    return _json({"sessions": sessions_in(desk.shelf.folder, desk.jobs.all)})


async def _upload(desk: Desk, request: "Request") -> "Response":
    length = request.headers.get("content-length", "")
    announced = int(length) if length.isdecimal() else None
    path = await uploads.receive(desk.shelf, request.query_params.get("name", ""), announced, request.stream())
    return _json({"name": path.relative_to(desk.shelf.folder).as_posix()})


async def _folder(desk: Desk, request: "Request") -> "Response":
    """A free name for a folder that is dropped in."""
    return _json({"name": desk.shelf.free(str((await _asked(request)).get("name", ""))).name})


async def _remove(desk: Desk, request: "Request") -> "Response":
    name = str((await _asked(request)).get("name", ""))
    await desk.stop_looking(name)
    return _json({"moved": str(desk.shelf.remove(name))})


async def _look(desk: Desk, request: "Request") -> "Response":
    """Look at a log again, or break a look off."""
    asked = await _asked(request)
    name = str(asked.get("name", ""))
    if asked.get("stop"):
        await desk.stop_looking(name)
    else:
        desk.forget(name)
    return _json({"name": name})


async def _ask(desk: Desk, request: "Request") -> "Response":
    """An answer within a second, and the command that does the same."""
    asked = await _asked(request)
    command = _command_of(desk, asked)
    return _json({**await desk.ask(asked), "command": command})


def _command_of(desk: Desk, asked: dict[str, Any]) -> str:
    if asked.get("what") == "cut":
        return command_line(task_of("replay", {**asked, "files": [asked.get("file", "")]}, desk.shelf).words)
    if asked.get("what") == "fly":
        asked["words"] = flight_words(asked)
        return command_line(task_of("fly", asked, desk.shelf).words)
    return ""


async def _requirement(desk: Desk, request: "Request") -> "Response":
    return _json({"name": kept_requirement(await _asked(request), desk.shelf)})


async def _start(desk: Desk, request: "Request") -> "Response":
    asked = await _asked(request)
    task = task_of(str(asked.get("kind", "")), asked, desk.shelf)
    return _json(desk.jobs.start(str(asked["kind"]), task).shown())


async def _cancel(desk: Desk, request: "Request") -> "Response":
    await desk.jobs.cancel(request.path_params["number"])
    return _json({})
