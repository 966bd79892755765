"""What a first call costs where no kernel is compiled yet, in processor time and memory, for each of our methods.

By hand: python benchmarks/compilation.py

Each call has a process and an empty cache of its own. The second call, in another process, finds the kernels on disk.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile

from pendbench.engines.registry import engine

CALL = """
import json, sys, time
import psutil
import pendbench as pb

effects = json.loads(sys.argv[2])
scene = pb.Scene.chain(n=3, length=1.0, mass=1.0, angles=0.5, gravity=9.81, duration=0.1, **effects)
memory, begun = psutil.Process().memory_info().rss, time.process_time()
pb.simulate(scene, method=sys.argv[1], dt=0.01 if sys.argv[3] == "fixed" else None)
print(json.dumps([time.process_time() - begun, (psutil.Process().memory_info().rss - memory) / 1e6]))
"""
SCENES = {"gravity alone": {}, "with joint damping": {"joint_damping": 0.05}}


def call(cache: str, method: str, effects: dict[str, float], step: str) -> tuple[float, float]:
    """Seconds of processor time and MB of memory that one call of `simulate` takes."""
    command = [sys.executable, "-c", CALL, method, json.dumps(effects), step]
    settings = {**os.environ, "XDG_CACHE_HOME": cache}
    settings.pop("NUMBA_CACHE_DIR", None)
    found = subprocess.run(command, env=settings, capture_output=True, text=True, check=True)
    seconds, megabytes = json.loads(found.stdout)
    return seconds, megabytes


def main() -> None:
    print("| method | scene | first call, s | MB | again, s | MB |\n| --- | --- | ---: | ---: | ---: | ---: |")
    for method, declared in engine("analytic").methods.items():
        step = "its own" if declared.adaptive else "fixed"
        for scene, effects in SCENES.items():
            if declared.effects is not None and not declared.effects >= set(effects):
                continue
            with tempfile.TemporaryDirectory() as cache:
                first, again = (call(cache, method, effects, step) for _ in range(2))
            numbers = f"{first[0]:.1f} | {first[1]:.0f} | {again[0]:.1f} | {again[1]:.0f}"
            print(f"| {method} | {scene} | {numbers} |", flush=True)


if __name__ == "__main__":
    main()
