"""The web server of the studio: pages, runs, saved machines, studies."""

import asyncio
import contextlib
import gc
import json
import os
import time
from collections.abc import AsyncIterator, Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Annotated, Any
from weakref import WeakKeyDictionary

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from wm_drake.batch.runs import Runner
from wm_drake.errors import LONGEST_LINE, InputError, input_error, shortened
from wm_drake.live.exported import STATIC
from wm_drake.live.machine import OpenMachine
from wm_drake.live.state import PageState, Text
from wm_drake.report.provenance import program
from wm_drake.studio.answers import (
    LANES,
    arrows,
    numbers,
    picture,
    picture_runner_of,
    runner_of,
)
from wm_drake.studio.forms import forms
from wm_drake.studio.guard import Guard
from wm_drake.studio.jobs import Jobs
from wm_drake.studio.machines import Machines
from wm_drake.studio.saving import ExistsAlreadyError, save_machine
from wm_drake.studio.turns import OvertakenError, Turns

KEPT_RANKINGS = 32
"""Number of rankings of the influential numbers that are kept."""

MOST_RANKED = 2000
"""Largest number of numbers whose influence a page may ask for."""

_REPORT_POLICY = (
    "sandbox allow-scripts allow-popups allow-downloads; default-src 'none'; img-src 'self' data: "
    "blob:; style-src 'unsafe-inline'; font-src data:; frame-src blob:; worker-src blob:; "
    "script-src 'unsafe-inline' 'unsafe-eval' blob:"
)
"""Policy of a report: it may draw itself, but it has no origin and reaches nothing."""


class _Body(BaseModel):
    model_config = ConfigDict(extra="forbid")


class RunRequest(_Body):
    """A run of what a page has chosen; `page` names the page."""

    page: Text
    state: PageState


class NumbersRequest(RunRequest):
    """The same with some numbers turned."""

    keys: Annotated[list[Text], Field(max_length=LANES)] = []


class RankingRequest(RunRequest):
    """Numbers whose influence on a run is wanted."""

    keys: Annotated[list[Text], Field(max_length=MOST_RANKED)]


class SaveRequest(_Body):
    """A machine to save."""

    state: PageState
    name: Text
    overwrite: bool = False


class StudyRequest(_Body):
    """A study to start."""

    state: PageState
    study: Text
    options: Annotated[dict[Text, Text], Field(max_length=8)] = {}


class Studio:
    """What all pages share: open machines, the threads that run them, studies."""

    def __init__(self, given: str, folder: Path, vary: str = "") -> None:
        """Serve a machine, save into a folder, and take ends of sliders from a vary file."""
        self.machines = Machines(given, folder, vary)
        self.jobs = Jobs(folder / "studies")
        self._workers = os.cpu_count() or 1
        self._executor = ThreadPoolExecutor(self._workers, thread_name_prefix="studio")
        self.cheap = ThreadPoolExecutor(2, thread_name_prefix="studio-cheap")
        self.turns = Turns(self._executor, self._workers)
        self._runners: WeakKeyDictionary[OpenMachine, tuple[Runner, Runner]] = WeakKeyDictionary()
        self._rankings: dict[str, asyncio.Task[list[dict[str, Any]]]] = {}

    def opened(self, identifier: str) -> tuple[OpenMachine, Runner, Runner]:
        """Return an open machine, the runner of its pictures and that of its numbers."""
        machine = self.machines.open(identifier)
        if machine not in self._runners:
            runners = picture_runner_of(machine), runner_of(machine)
            self._runners.setdefault(machine, runners)
            # a full collection over all that an open machine keeps takes as long as an answer
            gc.freeze()
        return machine, *self._runners[machine]

    def picture(self, state: PageState) -> dict[str, Any]:
        """Return the first part of the answer to a page, with the time that it took."""
        begin = time.perf_counter(), time.thread_time()
        machine, runner, _ = self.opened(state.machine)
        drawn = picture(machine, runner, state)
        passed = time.perf_counter() - begin[0], time.thread_time() - begin[1]
        return drawn | {"server_s": {"wall": passed[0], "cpu": passed[1]}}

    def numbers(self, state: PageState, keys: list[str]) -> dict[str, Any]:
        """Return the second part of the answer to a page."""
        machine, _, runner = self.opened(state.machine)
        return numbers(machine, runner, state, keys)

    async def ranking(self, state: PageState, keys: list[str]) -> list[dict[str, Any]]:
        """Return the arrows of numbers that influence a run; pages share the work."""
        key = f"{state.model_dump_json()} {keys}"
        task = self._rankings.get(key)
        if task is None or (task.done() and (task.cancelled() or task.exception())):
            task = asyncio.ensure_future(self._rank(key, state, keys))
            self._rankings[key] = task
            while len(self._rankings) > KEPT_RANKINGS:
                del self._rankings[next(iter(self._rankings))]
        return await asyncio.shield(task)

    async def _rank(self, key: str, state: PageState, keys: list[str]) -> list[dict[str, Any]]:
        take = partial(self.turns.take, f"ranking {key}", background=True)
        machine, _, runner = await take(lambda: self.opened(state.machine))
        keys = [name for name in dict.fromkeys(keys) if name in machine.sliders]
        effects: list[dict[str, Any]] = []
        for begin in range(0, len(keys), LANES):
            part = keys[begin : begin + LANES]
            effects += await take(partial(arrows, machine, runner, state, part))
        return effects

    def end(self) -> None:
        """End all studies and threads."""
        self.jobs.end()
        for executor in (self._executor, self.cheap):
            executor.shutdown(wait=False, cancel_futures=True)


def application(studio: Studio, token: str, port: int) -> Guard:
    """Return the guarded web application of a studio."""

    @contextlib.asynccontextmanager
    async def lifespan(_app: Starlette) -> AsyncIterator[None]:
        yield
        studio.end()

    routes = _Routes(studio)
    app = Starlette(
        routes=[
            Route("/", routes.page),
            Mount("/static", StaticFiles(directory=STATIC)),
            Route("/api/machines", routes.machines),
            Route("/api/machine", routes.machine),
            Route("/api/run", routes.run, methods=["POST"]),
            Route("/api/numbers", routes.numbers, methods=["POST"]),
            Route("/api/place", routes.place),
            Route("/api/ranking", routes.ranking, methods=["POST"]),
            Route("/api/save", routes.save, methods=["POST"]),
            Route("/api/studies", routes.studies),
            Route("/api/studies", routes.start, methods=["POST"]),
            Route("/api/studies/{id}/{act}", routes.act, methods=["POST"]),
            Route("/reports/{id}/{name:path}", routes.report),
        ],
        exception_handlers={InputError: _wrong, ValidationError: _malformed},
        lifespan=lifespan,
    )
    return Guard(app, token, port)


class _Routes:
    """What the server answers, by address."""

    def __init__(self, studio: Studio) -> None:
        self.studio = studio

    async def page(self, _request: Request) -> Response:
        """Return the page."""
        return FileResponse(STATIC / "index.html")

    async def machines(self, _request: Request) -> Response:
        """Return the machines that can be opened."""
        machines = self.studio.machines
        listed = await self._at_once(machines.listed)
        return _json(
            {
                "machines": [{"id": name, "kind": kind} for name, kind in listed.items()],
                "first": machines.first,
                "folder": str(machines.folder),
                "studies": forms(),
                "program": program(),
            }
        )

    async def machine(self, request: Request) -> Response:
        """Return one machine: its numbers, loads, shapes."""
        identifier = request.query_params.get("id", "")

        def opened() -> dict[str, object]:
            return self.studio.opened(identifier)[0].for_page()

        return _json(await asyncio.to_thread(opened))

    async def run(self, request: Request) -> Response:
        """Return the picture of what a page has chosen; a request that is overtaken is dropped."""
        body = RunRequest.model_validate_json(await request.body())
        run = partial(self.studio.picture, body.state)
        return await self._in_turn(f"page {body.page}", run)

    async def numbers(self, request: Request) -> Response:
        """Return the numbers to a picture; a request that is overtaken is dropped."""
        body = NumbersRequest.model_validate_json(await request.body())
        run = partial(self.studio.numbers, body.state, body.keys)
        return await self._in_turn(f"numbers {body.page}", run, background=True)

    async def _in_turn(
        self, page: str, calculate: Callable[[], Any], *, background: bool = False
    ) -> Response:
        try:
            return _json(await self.studio.turns.take(page, calculate, background=background))
        except OvertakenError:
            return _json({"overtaken": True})

    async def place(self, request: Request) -> Response:
        """Return how many runs come before the one that a page waits for."""
        page = request.query_params.get("page", "")
        return _json({"place": self.studio.turns.place(f"page {page}")})

    async def ranking(self, request: Request) -> Response:
        """Return the arrows of the numbers that a page wants to rank."""
        body = RankingRequest.model_validate_json(await request.body())
        return _json({"arrows": await self.studio.ranking(body.state, body.keys)})

    async def save(self, request: Request) -> Response:
        """Save a machine file."""
        body = SaveRequest.model_validate_json(await request.body())

        def save() -> str:
            machine, *_ = self.studio.opened(body.state.machine)
            with machine.lock:
                return save_machine(
                    self.studio.machines, machine, body.state, body.name, body.overwrite
                ).name

        return _json({"saved": await asyncio.to_thread(save)})

    async def studies(self, _request: Request) -> Response:
        """Return all studies."""
        return _json({"studies": await self._at_once(self.studio.jobs.listed)})

    async def start(self, request: Request) -> Response:
        """Start a study."""
        body = StudyRequest.model_validate_json(await request.body())

        def start() -> str:
            machine, *_ = self.studio.opened(body.state.machine)
            with machine.lock:
                return self.studio.jobs.start(
                    self.studio.machines, machine, body.state, body.study, body.options
                )

        return _json({"id": await asyncio.to_thread(start)})

    async def act(self, request: Request) -> Response:
        """Cancel or continue a study."""
        identifier, act = request.path_params["id"], request.path_params["act"]
        acts = {"cancel": self.studio.jobs.cancel, "resume": self.studio.jobs.resume}
        if act not in acts:
            raise input_error(f"no such act; allowed are {', '.join(acts)}", key="study")
        await self._at_once(partial(acts[act], identifier))
        return _json({"id": identifier})

    async def report(self, request: Request) -> Response:
        """Return a file of the results of a study."""
        find = self.studio.jobs.report_file
        path = await self._at_once(
            partial(find, request.path_params["id"], request.path_params["name"])
        )
        return FileResponse(path, headers={"content-security-policy": _REPORT_POLICY})

    async def _at_once(self, answer: Callable[[], Any]) -> Any:
        """Return an answer that needs no run: it does not wait for those that do."""
        return await asyncio.get_running_loop().run_in_executor(self.studio.cheap, answer)


def _json(content: Any, status: int = 200) -> Response:
    text = json.dumps(content, allow_nan=False, separators=(",", ":"))
    return Response(text, status, media_type="application/json")


async def _wrong(_request: Request, error: Exception) -> Response:
    """Return the problems of an input, each with the key of its value; long names are shortened."""
    assert isinstance(error, InputError)  # the handler of this type
    problems = []
    for problem in error.problems:
        is_of_file = problem.where and not problem.where.startswith("case ")
        place = f"{problem.where}: " if is_of_file else ""
        message = shortened(f"{place}{problem.message}", LONGEST_LINE)
        problems.append({"key": shortened(problem.key, LONGEST_LINE), "message": message})
    exists = isinstance(error, ExistsAlreadyError)
    return _json({"problems": problems, "exists": exists}, 409 if exists else 422)


async def _malformed(_request: Request, error: Exception) -> Response:
    """Refuse a body that no page sends."""
    assert isinstance(error, ValidationError)  # the handler of this type
    return _json({"problems": [{"key": "", "message": "the request is malformed"}]}, 400)
