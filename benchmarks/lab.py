"""How fast the live lab is: frames a second to a client that takes all it gets, latency of a slider, memory, idle load.

The client is a plain websocket that reads and throws away: what a browser then makes of it depends on its machine.
``python benchmarks/lab.py --minutes 60`` watches the memory for an hour.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import os
import struct
import threading
import time
from pathlib import Path

import numpy as np


class Client:
    """Connects as a page does, and counts the frames that it says it has drawn; a slow one waits between messages."""

    def __init__(self, address: str, pause: float = 0.0) -> None:
        self.address, self.pause = address.replace("http", "ws") + "live", pause
        self.origin = address.rsplit("/", 2)[0]
        self.bytes = self.frames = 0
        self.version = -1
        self.changed = threading.Condition()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._listen()), daemon=True)
        self._thread.start()

    async def _listen(self) -> None:
        from websockets.asyncio.client import connect

        async with connect(
            self.address, origin=self.origin, max_size=None, compression=None, ping_interval=None
        ) as socket:  # fmt: skip
            while not self._stop.is_set():
                with contextlib.suppress(TimeoutError):
                    message = await asyncio.wait_for(socket.recv(), 0.5)
                    self.bytes += len(message)
                    if isinstance(message, bytes):
                        self.frames += 1
                        size = struct.unpack("<I", message[:4])[0]
                        with self.changed:
                            self.version = json.loads(message[4 : 4 + size])["version"][0]
                            self.changed.notify_all()
                        await socket.send('{"kind": "drawn"}')
                    if self.pause:
                        await asyncio.sleep(self.pause)

    def close(self) -> None:
        self._stop.set()
        self._thread.join(5)


def resident() -> float:
    """MiB this process has in memory."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) / 1024
    return float("nan")


def opened(name: str) -> object:
    from flocking.apps.lab.page import Page
    from flocking.apps.lab.server import opened as server

    return Page(server(None), name)


def rates(page, seconds: float) -> dict[str, float]:
    client = Client(page.address)
    page.clock.play()
    time.sleep(3.0)
    frames, sent, now, drawn = page.clock.frame.number, client.bytes, page.clock.frame.time, client.frames
    begin = time.perf_counter()
    time.sleep(seconds)
    took = time.perf_counter() - begin
    found = {
        "frames/s": (client.frames - drawn) / took,
        "simulated frames/s": (page.clock.frame.number - frames) / took,
        "time/s": (page.clock.frame.time - now) / took,
        "MB/s": (client.bytes - sent) / took / 1e6,
    }
    page.clock.pause()
    client.close()
    return found


def latency(page, tries: int) -> np.ndarray:
    """Milliseconds from a slider's event to the first frame of the changed law that reaches the client."""
    found = []
    client = Client(page.address)
    page.clock.play()
    time.sleep(1.0)
    for k in range(tries):
        version = page.experiment.version
        begin = time.perf_counter()
        page.send({"kind": "set", "path": ["law", "terms", 1, "gain"], "value": 0.5 + 0.01 * k}, "gain")
        with client.changed:
            client.changed.wait_for(lambda version=version: client.version > version, 10.0)
        found.append(1e3 * (time.perf_counter() - begin))
        time.sleep(0.05)
    page.clock.pause()
    client.close()
    return np.array(found)


def idle(page, seconds: float) -> float:
    """Share of one processor used while paused."""
    page.clock.pause()
    time.sleep(2.0)
    begin = time.process_time()
    time.sleep(seconds)
    return (time.process_time() - begin) / seconds


def speeds(seconds: float, names: tuple[str, ...] = ("group-1000", "group-10000", "group-100000")) -> None:
    """Rates, latency and idle load of groups of three sizes."""
    for name in names:
        page = opened(name)
        found = rates(page, seconds)
        waits = latency(page, 20)
        said = ", ".join(f"{value:.3g} {key}" for key, value in found.items())
        print(f"{name}: {said}; slider to frame {np.median(waits):.0f} ms, worst {waits.max():.0f}", flush=True)
        if name == "group-1000":
            print(f"{name}: {100 * idle(page, seconds):.1f} % of a processor while paused", flush=True)
        page.close()


def memory(minutes: float, samples: Path | None) -> None:
    """Memory of 1,000 agents that run while a slider moves, agents go and come, and tabs open and close."""
    page = opened("group-1000")
    clients = [Client(page.address), Client(page.address, pause=0.5)]
    page.clock.play()
    begin, turn, rows = time.monotonic(), 0, []
    while (passed := time.monotonic() - begin) < 60 * minutes:
        rows.append((passed, resident(), page.clock.frame.time))
        if samples:
            np.savetxt(samples, rows, fmt="%.1f", delimiter=",", header="seconds,MiB,t", comments="")
        if turn % 20 == 0:
            print(f"  {rows[-1][1]:.0f} MiB after {passed / 60:.1f} min, at t = {rows[-1][2]:.0f}", flush=True)
        turn += 1
        page.send({"kind": "set", "path": ["law", "terms", 1, "gain"], "value": 0.2 + 0.001 * (turn % 50)}, "gain")
        if turn % 4 == 0:
            state = page.clock.frame.states[0]
            page.send({"kind": "kill", "agents": [turn % state.n]})
            page.send({"kind": "add", "q": (state.q.mean(axis=0)).tolist(), "p": state.p.mean(axis=0).tolist()})
            passing = Client(page.address)
            time.sleep(3.0)
            passing.close()
        time.sleep(12.0)
    table = np.array(rows)
    late = table[table[:, 0] >= table[-1, 0] / 6]
    slope = np.polyfit(late[:, 0] / 3600, late[:, 1], 1)[0] if len(late) > 2 else float("nan")
    print(
        f"memory of 1,000 agents: {late[0, 1]:.0f} MiB after {late[0, 0] / 60:.0f} min, {late[-1, 1]:.0f} MiB after "
        f"{late[-1, 0] / 60:.0f} min; slope {slope:+.1f} MiB an hour; {page.last_error or 'nothing was refused'}"
    )
    for client in clients:
        client.close()
    page.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--minutes", type=float, default=3.0, help="how long to watch the memory; 0 for not at all")
    parser.add_argument("--memory-only", action="store_true")
    parser.add_argument("--samples", type=Path, help="CSV file for what the memory was")
    options = parser.parse_args()
    print(f"{os.cpu_count()} processors")
    if not options.memory_only:
        speeds(options.seconds)
    if options.minutes:
        memory(options.minutes, options.samples)


if __name__ == "__main__":
    main()
