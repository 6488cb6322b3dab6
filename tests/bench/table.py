# SPDX-License-Identifier: BSD-3-Clause
"""Joins the JSON of several benchmark programs and prints their least times.

  table.py FOLDER [OUT.json]
"""
import json
import os
import pathlib
import sys

MILLISECONDS = {"ns": 1e-6, "us": 1e-3, "ms": 1, "s": 1e3}
TIMES = {"name", "run_name", "run_type", "family_index", "per_family_instance_index",
         "repetitions", "repetition_index", "threads", "iterations", "real_time", "cpu_time",
         "time_unit"}


def main(folder, out=""):
    joined = {"benchmarks": []}
    for file in sorted(pathlib.Path(folder).glob("*.json")):
        if file.stat().st_size == 0:  # nothing matched the filter
            continue
        part = json.loads(file.read_text())
        joined.setdefault("context", part["context"])
        joined["benchmarks"] += part["benchmarks"]
    least = {}
    for run in joined["benchmarks"]:
        if run.get("run_type") == "aggregate":
            continue
        time = run["cpu_time"] * MILLISECONDS[run["time_unit"]]
        name = run["run_name"]
        if name not in least or time < least[name][0]:
            least[name] = (time, {k: v for k, v in run.items() if k not in TIMES})
    print(f"{'benchmark':<44} {'ms':>10}  ")
    for name, (time, counters) in sorted(least.items()):
        extra = "  ".join(f"{k} {v:.4g}" for k, v in counters.items())
        print(f"{name:<44} {time:>10.4f}  {extra}".rstrip())
    if out:
        temporary = out + ".part"
        pathlib.Path(temporary).write_text(json.dumps(joined, indent=1))
        os.replace(temporary, out)


if __name__ == "__main__":
    main(*sys.argv[1:3])
