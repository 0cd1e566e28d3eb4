"""An environment of Python with what users have beside tumble, from PyPI: Debian's VTK reads no XDMF, and its numpy has no pyvista beside it.

Installed once into build/packages (800 MB, most of it VTK) and kept there; tests that need it are skipped where PyPI cannot be reached or the disk
has no room for it, and share an xdist_group, so that one worker waits.
"""
import fcntl
import shutil
import subprocess
import sys

import numpy as np
import pytest

from collector import build_folder

# with the machine's numpy, for which its h5py was built; matplotlib: Debian's knows no notebooks of today
PACKAGES = ["pyvista", "meshio", "pandas", "jsonschema", "nbclient", "ipykernel", "matplotlib>=3.8", f"numpy=={np.__version__}"]
NOT_OURS = ("NewConnectionError", "NameResolutionError", "ConnectTimeoutError", "ReadTimeoutError", "ProxyError", "Connection refused",
            "No matching distribution found", "No space left on device")
GROUP = "packages"


def install(folder):
    """None, or why there is no such environment."""
    words = "\n".join([sys.version, *PACKAGES])
    ready = folder / "ready"
    if ready.exists() and ready.read_text() == words:
        return None
    subprocess.run([sys.executable, "-m", "venv", "--clear", "--without-pip", "--system-site-packages", folder], check=True)
    done = subprocess.run([folder / "bin" / "python", "-m", "pip", "install", "--quiet", "--retries", "1", *PACKAGES], capture_output=True, text=True)
    if done.returncode and any(word in done.stderr for word in (*NOT_OURS, "No module named pip")):
        shutil.rmtree(folder)
        return done.stderr.strip().splitlines()[-1]
    assert done.returncode == 0, done.stderr
    ready.write_text(words)
    return None


@pytest.fixture(scope="session")
def packages():
    """The path of its interpreter."""
    folder = build_folder() / "packages"
    with open(build_folder() / "packages.lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        reason = install(folder)
    if reason:
        pytest.skip(f"cannot be installed from PyPI: {', '.join(PACKAGES)}: {reason}")
    return folder / "bin" / "python"
