"""python -m equipoise_tools.cockpit: a page on 127.0.0.1 that shows and drives a robot; docs/cockpit.md."""

from __future__ import annotations

import argparse
import asyncio
import signal
import sys
import tempfile
from pathlib import Path

import tornado.httpserver
import tornado.netutil

from ..entry import leave
from ..paths import UserError, repository_root
from ..view import open_source
from .hub import Cockpit
from .robot import HOLDER, Remote, SimulatedRobot, make_key, private_url
from .server import LIBRARIES, MODULES, application

CONFIGS = {"mbbr": "config/mbbr.toml", "mip": "config/edumip.toml", "edumip": "config/edumip.toml"}


def parse(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="tools/cockpit",
        description="Shows a robot in the browser, on 127.0.0.1 only, and drives it: a simulated one that it "
        "starts, or one that is attached by --telemetry.",
        epilog="Examples: tools/cockpit --robot edumip; "
        "tools/cockpit --arm -- --robot 7 --fault encoder_dead@20; "
        "tools/cockpit --telemetry 'udpm://239.255.76.67:7667?ttl=1' --key anna.key",
    )
    parser.add_argument(
        "--robot", choices=sorted(CONFIGS), help="which robot to simulate, or is attached (default: mbbr)"
    )
    parser.add_argument("--config", metavar="FILE", help="its configuration (default: that of --robot)")
    parser.add_argument(
        "--port", type=int, default=8421, help="of the page; 0: any free one (default: %(default)s)"
    )
    parser.add_argument("--telemetry", metavar="URL", help="attach to a running robot: its LCM telemetry")
    parser.add_argument(
        "--key", metavar="FILE", help="attached: a holder's key, to command it; without: read-only"
    )
    parser.add_argument(
        "--command-url", metavar="URL", help="attached: its --command-url (default: --telemetry's)"
    )
    parser.add_argument(
        "--as", dest="holder", metavar="NAME", help="attached: your name, with a robot's own key"
    )
    parser.add_argument(
        "--logs",
        metavar="DIR",
        type=Path,
        default=repository_root() / "logs",
        help="to play and record (default: logs)",
    )
    parser.add_argument("--arm", action="store_true", help="arm the simulated robot once, at the start")
    parser.add_argument(
        "run", nargs="*", metavar="RUN OPTION", help="after --: options of equipoise run --backend sim"
    )
    options = parser.parse_args(arguments)
    if options.telemetry is None and (options.key or options.command_url or options.holder):
        raise UserError(
            "--key, --command-url and --as go with --telemetry; a simulated robot has a key of its own"
        )
    if options.telemetry is not None and options.arm:
        raise UserError("--arm: only a simulated robot is armed by a program")
    if options.telemetry is not None and options.run:
        raise UserError(f"{options.run[0]}: an attached robot is running already")
    if options.config is None and (options.telemetry is None or options.robot):
        options.config = CONFIGS[options.robot or "mbbr"]
    if options.config is not None and not (repository_root() / options.config).is_file():
        raise UserError(f"{options.config}: no such file")
    missing = [file for file in LIBRARIES.values() if not (MODULES / file).is_file()]
    if missing:
        raise UserError(f"build/page/node_modules/{missing[0]}: not installed; ./tools/cockpit does it")
    options.title = "simulated robot" if options.telemetry is None else f"robot on {options.telemetry}"
    if options.robot == "edumip":
        options.robot = "mip"
    return options


async def serve(options: argparse.Namespace) -> int:
    cockpit = Cockpit(options)
    loop = asyncio.get_running_loop()
    stop = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop.set)
    try:
        sockets = tornado.netutil.bind_sockets(options.port, "127.0.0.1")
    except OSError as error:
        raise UserError(f"--port {options.port}: {error.strerror}; --port 0 takes any free one") from None
    cockpit.port = sockets[0].getsockname()[1]
    url = options.telemetry or private_url()
    source = open_source(url)
    source.subscribe("EQUIPOISE_.*", cockpit.hear).set_queue_capacity(200)
    loop.add_reader(source.fileno(), source.handle)
    with tempfile.TemporaryDirectory(prefix="equipoise-cockpit-") as folder:
        if options.telemetry is None:
            key = make_key(Path(folder), "simulated")
            cockpit.simulated = SimulatedRobot(options.config, url, key, options.run, cockpit.changed)
            cockpit.remote = Remote(url, key, HOLDER, cockpit.changed)
        elif options.key:
            cockpit.remote = Remote(
                options.command_url or url, Path(options.key), options.holder, cockpit.changed
            )
        # Nobody sends us a body; what comes before a request's host is known stays small.
        server = tornado.httpserver.HTTPServer(
            application(cockpit), max_body_size=1024, max_buffer_size=1 << 20, max_header_size=1 << 14
        )
        server.add_sockets(sockets)
        try:
            await cockpit.load_parameters()
            if cockpit.simulated is not None:
                await cockpit.simulated.start()
            if cockpit.remote is not None:
                cockpit.remote.start()
            watch = asyncio.create_task(cockpit.watch())
            if options.arm:
                await cockpit.remote.first_status()
                cockpit.remote.say("arm")
            print(f"Open http://127.0.0.1:{cockpit.port}/#{cockpit.token}   (Ctrl-C ends)", flush=True)
            await stop.wait()
            watch.cancel()
        finally:
            server.stop()
            loop.remove_reader(source.fileno())
            await cockpit.close()
    return 0


def main(arguments: list[str] | None = None) -> int:
    try:
        return asyncio.run(serve(parse(arguments)))
    except UserError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    leave(main)
