"""`cusp demo`: a dental arch and its print, or the user's own pair, through the whole service and back.

Does what a client would do by `curl`, and says so: upload, poll, results, files.
"""

import json
import shlex
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import numpy as np
from pydantic import ValidationError
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from pipeline import RegistrationResult
from service.client import Client, ServiceProblem, ServiceUnreachable
from service.client.requests import JobOptions
from service.client.results_table import print_results
from service.contract.schemas import Job, Status
from service.demo import arch as demo_arch
from service.demo.arch import FloatArray, Surface

LOOPBACK = ("127.0.0.1", "localhost", "::1")
START_TIMEOUT_S = 60.0  # imports of a cold disk included
STOP_TIMEOUT_S = 20.0
TOLERANCE_MM = 0.2  # of the summary: what printed dental models are held to
MIN_WITHIN = 0.9  # share of the area within it, from which on the example passes; by hand


class DemoProblem(Exception):
    """Why the demo stops, and what to do."""


def run_demo(
    *, server: str, data_dir: Path, out: Path, design: Path | None, scan: Path | None, seed: int
) -> int:
    """Register a pair through the service at `server`, started with `data_dir` if none answers, and explain.

    design, scan : the user's files, both or neither; neither makes the pair by formula, varied by `seed`
    out : folder for the pair, every file of the job, and the log of a service started here

    Returns
    -------
    int
        Exit code: 0 verdict ok, 3 another verdict, 1 no result.
    """
    console = Console(highlight=False, soft_wrap=True)
    try:
        out.mkdir(parents=True, exist_ok=True)
        design, scan, truth = _pair(console, design, scan, out, seed)
        with Client(server) as client, _service(console, client, data_dir, out / "service.log"):
            job = _submit(console, client, design, scan, seed)
            job = _watch(console, client, job)
            results = client.results(job.id)
            result = RegistrationResult.model_validate(results)
            names = [file.name for file in client.files(job.id)]
            for name in names:
                client.download(job.id, name, out / Path(name).name)
            console.print()
            print_results(results, None, console)
            _explain(console, result)
            if truth is not None:
                _compare(console, result, truth, out)
            console.print(f"\nFiles in {escape(str(out))}: {escape(', '.join(names))}")
            console.print(f"The JSON again: curl -s {client.server}/v1/jobs/{job.id}/results")
    except ValidationError as error:
        return _give_up(console, f"The service at {server} speaks another version of the results: {error}")
    except (DemoProblem, ServiceProblem, ServiceUnreachable, OSError, httpx.HTTPError) as error:
        return _give_up(console, str(error))
    return 0 if result.verdict.status == "ok" else 3


def _give_up(console: Console, sentence: str) -> int:
    console.print(f"[bold red]The demo stops.[/bold red] {escape(sentence)}")
    return 1


def _pair(
    console: Console, design: Path | None, scan: Path | None, out: Path, seed: int
) -> tuple[Path, Path, FloatArray | None]:
    """Design, scan, and for the pair made here the known T_design_scan (4, 4)."""
    if design is not None and scan is not None:
        for path in (design, scan):
            if not path.is_file():
                raise DemoProblem(f"There is no file {path}.")
        return design, scan, None
    if design is not None or scan is not None:
        raise DemoProblem("Give both --design and --scan, or neither for a dental arch made by formula.")
    console.print(
        "Making a dental arch by formula, and a print of it: "
        f"{demo_arch.SHRINK:.1%} shrink, a warp of {demo_arch.WARP_MM} mm, noise of {demo_arch.NOISE_MM} mm, "
        "other triangles, a random pose."
    )
    printed = demo_arch.printed(seed=seed)
    design, scan = out / "design.stl", out / "scan.ply"
    _write(demo_arch.arch(seed=seed), design)
    _write(printed.scan, scan)
    truth = {"seed": seed, "T_design_scan": printed.T_design_scan.tolist()}
    (out / "truth.json").write_text(json.dumps(truth, indent=2) + "\n", encoding="utf-8")
    return design, scan, printed.T_design_scan


def _write(surface: Surface, path: Path) -> None:
    import trimesh  # here: the command line starts without it

    trimesh.Trimesh(surface.vertices, surface.faces, process=False).export(path)


@contextmanager
def _service(console: Console, client: Client, data_dir: Path, log: Path) -> Iterator[None]:
    """The service that answers at the address of `client`; started for the while if none does."""
    if client.is_ready():
        console.print(f"Using the service at {client.server}.")
        yield
        return
    address = urlsplit(client.server)
    if address.scheme != "http" or address.hostname not in LOOPBACK:
        raise DemoProblem(f"No service answers at {client.server}, and only a local one can be started here.")
    console.print(f"No service answers at {client.server}: starting one, log in {escape(str(log))}.")
    command = [sys.executable, "-m", "service.cli.main", "up", "--host", address.hostname]
    command += ["--port", str(address.port or 80), "--data-dir", str(data_dir)]
    with log.open("wb") as file:
        process = subprocess.Popen(  # noqa: S603 (our own module, arguments as a list)
            command, stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT
        )
    try:
        _wait_ready(client, process, log)
        yield
    finally:
        _stop(process)
    again = f"cusp up --port {address.port or 80} --data-dir {shlex.quote(str(data_dir))}"
    console.print(f"The service started for the demo is stopped; its jobs are kept: {escape(again)}")


def _wait_ready(client: Client, process: subprocess.Popen[bytes], log: Path) -> None:
    deadline = time.monotonic() + START_TIMEOUT_S
    while not client.is_ready():
        ended = process.poll()
        if ended is not None or time.monotonic() > deadline:
            said = "\n".join(log.read_text(encoding="utf-8", errors="replace").splitlines()[-15:])
            how = (
                f"is not ready after {START_TIMEOUT_S:.0f} s" if ended is None else f"ended with code {ended}"
            )
            raise DemoProblem(f"The service started for the demo {how}. The end of its log, {log}:\n{said}")
        time.sleep(0.2)


def _stop(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        process.wait(STOP_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _submit(console: Console, client: Client, design: Path, scan: Path, seed: int) -> Job:
    options: JobOptions = {
        "seed": seed,
        "tolerance_mm": TOLERANCE_MM,
        "acceptance": {"min_within": MIN_WITHIN},
        "label": "cusp demo",
    }
    curl = ["curl", "-F", f"design=@{design}", "-F", f"scan=@{scan}", "-F", f"options={json.dumps(options)}"]
    console.print("Uploading both, as this would:")
    console.print(f"  {escape(shlex.join([*curl, client.server + '/v1/jobs']))}")
    job = client.submit(design, scan, options)
    console.print(
        f"Job {job.id} is {job.status.value}; polling {client.server}{job.links.self}", soft_wrap=True
    )
    return job


def _watch(console: Console, client: Client, job: Job) -> Job:
    """Poll behind a progress bar; a job that does not end well is a problem."""
    columns = (TextColumn("{task.description:<14}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console) as bar:
        task = bar.add_task("queued", total=100)

        def show(now: Job) -> None:
            word = now.status.value if now.is_final or now.stage is None else now.stage.value
            bar.update(task, description=word, completed=now.progress)

        job = client.wait(job.id, show)
    if job.status is Status.SUCCESSFUL:
        return job
    reason = job.error.detail if job.error else "no reason given"
    raise DemoProblem(f"The job {job.id} is {job.status.value}: {reason}")


def _explain(console: Console, result: RegistrationResult) -> None:
    """What the summary leaves out: K, the deviation, the landmarks."""
    if (k_ratio := result.metrics.k_ratio) is not None:
        console.print(f"K, RMSE without landmarks over by landmarks alone: {k_ratio:.2f}")
    if (found := result.deviation) is not None:
        within = "" if found.within is None else f"; {found.within:.1%} within {found.tolerance_mm} mm"
        console.print(
            f"deviation: mean {found.mean_mm:+.3f} mm, SD {found.sd_mm:.3f} mm, "
            f"5 % to 95 % {found.p05_mm:+.3f} to {found.p95_mm:+.3f} mm{within}"
        )
    marks = result.landmarks
    console.print(
        f"landmarks: {len(marks.design)} on the design, {len(marks.scan)} on the scan, "
        f"{len(marks.matches)} matched"
    )


def _compare(console: Console, result: RegistrationResult, truth: FloatArray, out: Path) -> None:
    """Say how far the pose found is from the known one: rotation, and RMS displacement over the scan."""
    if result.transform is None:
        return
    import trimesh

    points = np.asarray(trimesh.load_mesh(out / "scan.ply", process=False).vertices)
    found = np.array(result.transform.matrix)
    turn = found[:3, :3] @ truth[:3, :3].T
    # of R - I the norm is 2 sqrt(2) sin(angle / 2): accurate near zero, where acos is not
    half_sine = min(1.0, float(np.linalg.norm(turn - np.eye(3))) / (2.0 * np.sqrt(2.0)))
    rotation_deg = float(np.degrees(2.0 * np.arcsin(half_sine)))
    off_mm = np.linalg.norm(points @ (found - truth)[:3, :3].T + (found - truth)[:3, 3], axis=1)
    console.print(
        f"true error of the pose, known here: rotation {rotation_deg:.3f} deg, "
        f"displacement RMS {np.sqrt((off_mm**2).mean()):.3f} mm"
    )
