"""Cores of this machine: how many one may use, how many are idle."""

import math
import os
import re
import time
from pathlib import Path


def count_cores():
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def read_quota(group="/proc/self/cgroup", root="/sys/fs/cgroup"):
    """Cores that a container may use, such as 1.5; infinite where nothing limits them."""
    least = math.inf
    try:
        lines = Path(group).read_text().splitlines()
    except OSError:
        lines = []
    for names, path in ((names, path) for _, names, path in (line.split(":", 2) for line in lines if line.count(":") >= 2)):
        if names and "cpu" not in names.split(","):
            continue
        top = Path(root, "cpu") if names else Path(root)
        for folder in (top, *(Path(top, *Path(path).parts[1 : n + 1]) for n in range(1, len(Path(path).parts)))):
            try:
                words = (folder / "cpu.max").read_text().split() if not names else [(folder / f"cpu.cfs_{name}_us").read_text() for name in ("quota", "period")]
                least = min(least, float(words[0]) / float(words[1])) if words[0] != "max" and float(words[0]) > 0 else least
            except (OSError, ValueError, IndexError):
                pass
    return least


def read_idle(cores):
    """Idle time of each core so far, s; {} where the system does not tell."""
    try:
        lines = Path("/proc/stat").read_text().splitlines()
    except OSError:
        return {}
    ticks = {int(words[0][3:]): int(words[4]) + int(words[5]) for words in map(str.split, lines) if re.match(r"cpu\d+$", words[0])}
    return {core: ticks[core] / os.sysconf("SC_CLK_TCK") for core in cores if core in ticks}


def free_cores(most=None, seconds=0.3):
    """Cores that are idle now, of those that this process may use: at least one, at most `most`."""
    allowed = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else range(os.cpu_count() or 1)
    before, began = read_idle(allowed), time.monotonic()
    if before:
        time.sleep(seconds)
        after, wall = read_idle(allowed), time.monotonic() - began
        idle = sum(min(1, (after[core] - before[core]) / wall) for core in before)
    else:
        idle = len(allowed) - os.getloadavg()[0]
    free = min(idle, read_quota()) + 0.25  # others also do little things
    return max(1, min(int(free), most or int(free)))
