"""Memory that this process may still take, and what a body takes of it."""

import math
from pathlib import Path

# Of matrices, temporaries of the assembly and Krylov vectors, without the factor: measured 7.9 to
# 8.3 kB for slabs of 76,000 to 260,000 dofs at five probes.
BYTES_PER_DOF = 8.3e3
CGROUP = Path("/sys/fs/cgroup")


def check_memory(dofs: int) -> None:
    """Refuse, by a MemoryError and before anything is assembled, a body whose matrices take more
    memory than is free, even with their factor in files.
    """
    needed, free = BYTES_PER_DOF * dofs, free_memory()
    if needed > free:
        raise MemoryError(
            f"{dofs:,} degrees of freedom take about {needed / 2**30:.2g} GiB beside their factor, "
            f"and {free / 2**30:.2g} GiB of memory are free, enough for {free / BYTES_PER_DOF:,.0f}"
            "; take larger elements or a smaller body"
        )


def free_memory() -> float:
    """Bytes that may still be taken, of the machine's or of the container's; infinite where the
    system does not tell.
    """
    return min(_of_machine(), _of_container())


def _of_machine() -> float:
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
    except OSError:
        return math.inf
    known = dict(line.split(":", 1) for line in lines)
    return 1024.0 * int(known["MemAvailable"].split()[0])


def _of_container() -> float:
    try:
        most = (CGROUP / "memory.max").read_text(encoding="ascii").strip()
        taken = (CGROUP / "memory.current").read_text(encoding="ascii")
    except OSError:
        return math.inf
    return math.inf if most == "max" else float(most) - float(taken)
