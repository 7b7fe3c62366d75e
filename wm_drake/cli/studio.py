"""Command `wm-drake studio`: a page on this computer that runs a machine while a slider moves."""

import logging
import secrets
import socket
import webbrowser
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from wm_drake.cli.common import MachineOption
from wm_drake.errors import input_error, reason_of
from wm_drake.report.terminal import say

DEFAULT_FOLDER = Path("wm-drake-studio")


def studio(
    machine: MachineOption = "reference",
    folder: Annotated[
        Path, typer.Option(help="Folder for saved machine files and studies.", metavar="DIR")
    ] = DEFAULT_FOLDER,
    vary: Annotated[
        str, typer.Option(help="Vary file with the ends of sliders: low and high.", metavar="FILE")
    ] = "",
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the address and open no browser.")
    ] = False,
    port: Annotated[
        int, typer.Option(help="Port of the server. Default: a free one.", min=0, max=65535)
    ] = 0,
    link: Annotated[
        str,
        typer.Option(
            help="Permanent link of an earlier page: all after its '#' is opened again.",
            metavar="URL",
        ),
    ] = "",
) -> None:
    """Open a page on this computer that runs a machine again at each move of a slider."""
    missing = [name for name in ("starlette", "uvicorn") if find_spec(name) is None]
    if missing:
        raise input_error(
            f"needs {' and '.join(missing)}: pip install 'wm-drake[studio]'", where="studio"
        )
    import uvicorn

    from wm_drake.parameters import machine_path, shipped_machines
    from wm_drake.studio.guard import TimedConnection
    from wm_drake.studio.server import Studio, application

    given = machine if machine in shipped_machines() else str(machine_path(machine).resolve())
    served = Studio(given, folder.resolve(), vary)
    served.machines.open(served.machines.first)  # an error of the file is shown here
    token = secrets.token_urlsafe(24)
    with _loopback(port) as listening:
        _make(folder)  # last, so that no refused command leaves it
        number = listening.getsockname()[1]
        fragment = link.partition("#")[2]
        address = f"http://127.0.0.1:{number}/{token}/" + (f"#{fragment}" if fragment else "")
        typer.echo(f"wm-drake studio: {address}")
        say(f"machine files are saved in {folder}; Ctrl-C ends the server")
        if not no_browser:
            webbrowser.open(address)
        config = uvicorn.Config(
            application(served, token, number),
            log_level="warning",
            access_log=False,  # it would have the token
            ws="none",
            http=TimedConnection,
            timeout_graceful_shutdown=3,
        )
        log = logging.getLogger("uvicorn.error")  # what Ctrl-C leaves unfinished is no error
        log.addFilter(lambda line: "graceful shutdown exceeded" not in line.msg)
        uvicorn.Server(config).run(sockets=[listening])


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = f"cannot be written to: {reason_of(error)}"
        raise input_error(reason, where=str(folder)) from None


def _loopback(port: int) -> socket.socket:
    """Return a socket that listens on this computer only."""
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        listening.bind(("127.0.0.1", port))
        listening.listen()  # a page that comes at once waits until the server is ready
    except OSError as error:
        listening.close()
        raise input_error(f"{port}: {reason_of(error)}", where="--port") from None
    return listening
