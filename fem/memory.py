"""Free memory, and the memory that a body needs."""

import math
from pathlib import Path

# Matrices, temporaries of the assembly and Krylov vectors, without the factor: measured as 7.9 to
# 8.3 kB for slabs of 76,000 to 260,000 dofs with five probes.
BYTES_PER_DOF = 8.3e3


def check_memory(dofs: int) -> None:
    """Raise a MemoryError if the matrices of a body need more memory than is free."""
    needed, free = BYTES_PER_DOF * dofs, free_memory()
    if needed > free:
        raise MemoryError(
            f"{dofs:,} degrees of freedom need about {needed / 2**30:.2g} GiB of memory plus the "
            f"factor, but only {free / 2**30:.2g} GiB are free, enough for "
            f"{free / BYTES_PER_DOF:,.0f} degrees of freedom; use larger elements or a smaller body"
        )


def free_memory() -> float:
    """Return the free bytes of the machine or container; infinity where the system reports none."""
    return min(_free_of_machine(), _free_of_container())


def _free_of_machine() -> float:
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
    except OSError:
        return math.inf
    sizes = dict(line.split(":", 1) for line in lines)
    return 1024.0 * int(sizes["MemAvailable"].split()[0])


def _free_of_container() -> float:
    cgroup = Path("/sys/fs/cgroup")
    try:
        limit = (cgroup / "memory.max").read_text(encoding="ascii").strip()
        used = (cgroup / "memory.current").read_text(encoding="ascii")
    except OSError:
        return math.inf
    return math.inf if limit == "max" else float(limit) - float(used)
