"""Files of measurements as other libraries write them: one small recording in each format."""

import csv
import warnings
import wave
from pathlib import Path

import h5py
import numpy as np
import pyuff
from scipy.io import savemat, wavfile

RATE = 2000.0
T = np.arange(48) / RATE
PLACES_MM = np.array([[0.0, 0.0], [5.0, 0.0], [10.5, -2.25]])
MM_S = np.random.default_rng(11).normal(size=(2, len(T), 3)).round(9)  # mm/s
DRIVE = np.sin(2 * np.pi * 140 * T)
F = np.array([100.0, 140.0, 280.0, 333.3])
UM = np.random.default_rng(12).normal(size=(1, 4, 3, 2)).round(9) @ np.array([1, 1j])  # um


def wide_csv(path: Path) -> None:
    heads = [f"v({x},{y}){tag} [mm/s]" for tag in ("", "#2") for x, y in PLACES_MM]
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["t [s]", *heads, "drive"])
        for k, t in enumerate(T):
            writer.writerow([t, *MM_S[0, k], *MM_S[1, k], DRIVE[k]])


def long_tsv(path: Path) -> None:
    with path.open("w", newline="") as file:
        writer = csv.writer(file, delimiter="\t")
        writer.writerow(["t_ms", "probe_x_mm", "probe_y_mm", "velocity_mm_s", "repetition"])
        for r in range(2):
            for k, t in enumerate(T):
                for p, (x, y) in enumerate(PLACES_MM):
                    writer.writerow([1e3 * t, x, y, MM_S[r, k, p], r + 1])


def spectrum_csv(path: Path) -> None:
    heads = [f"{part} u({x},{y}) [um]" for x, y in PLACES_MM for part in ("re", "im")]
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["f [Hz]", *heads])
        for k, f in enumerate(F):
            writer.writerow([f, *(x for u in UM[0, k] for x in (u.real, u.imag))])


def numpy_npz(path: Path) -> None:
    np.savez(path, time=T, velocity=MM_S, unit="mm/s", places_mm=PLACES_MM, reference=DRIVE)


def matlab_5(path: Path) -> None:
    savemat(path, {"rec": {"t": T[:, None], "v": np.moveaxis(MM_S, 0, 2), "unit": "mm/s"},
                   "places": PLACES_MM / 1e3})  # fmt: skip


def matlab_73(path: Path) -> None:
    """As MATLAB has it: axes in reverse, text as numbers of letters, behind 512 bytes."""
    with h5py.File(path, "w", userblock_size=512) as file:
        file["t"] = T[:, None].T
        file["v"] = np.transpose(MM_S)
        file["places_mm"] = PLACES_MM.T
        file["unit"] = np.array([ord(c) for c in "mm/s"], np.uint16)[:, None]
        file["unit"].attrs["MATLAB_class"] = np.bytes_("char")


def wav_16(path: Path) -> None:
    with wave.open(str(path), "wb") as file:
        file.setparams((2, 2, int(RATE), 0, "NONE", ""))
        file.writeframes(samples_16().tobytes())


def samples_16() -> np.ndarray:
    return (MM_S[0, :, :2] * 8000).clip(-32768, 32767).astype("<i2")


def wav_float(path: Path) -> None:
    wavfile.write(path, int(RATE), MM_S[0].astype(np.float32))


def uff_nodes(x: np.ndarray, y: np.ndarray) -> dict:
    node = np.arange(1, len(x) + 1)
    return pyuff.prepare_2411(node_nums=node, def_cs=0 * node, disp_cs=0 * node, color=0 * node,
                              x=x, y=y, z=0 * x)  # fmt: skip


def write_uff(path: Path, sets: list) -> Path:
    path.unlink(missing_ok=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # pyuff does not close binary files
        pyuff.UFF(str(path)).write_sets(sets, "add")
    return path


def universal(path: Path, *, binary: int = 0, complex_: bool = False, **changes: object) -> None:
    """Nodes in mm, both repetitions of each, along z."""
    units = pyuff.prepare_164(units_code=5, units_description="mm (milli-newton)", temp_mode=1,
                              length=1e3, force=1e3, temp=1.0, temp_offset=0.0)  # fmt: skip
    sets = [units, uff_nodes(*PLACES_MM.T)]
    values, axis = (UM, F) if complex_ else (MM_S, T)
    for run in values:
        for p in range(3):
            kept = {
                "binary": binary, "func_type": 4 if complex_ else 1, "rsp_node": p + 1,
                "rsp_dir": 3, "ref_node": 0, "ref_dir": 0, "rsp_ent_name": "NONE",
                "ref_ent_name": "NONE", "id1": "palm", "data": run[:, p], "x": axis,
                "abscissa_spacing": 0 if complex_ else 1,
                "abscissa_spec_data_type": 18 if complex_ else 17,
                "ordinate_spec_data_type": 8 if complex_ else 11, "orddenom_spec_data_type": 0,
                "ordinate_axis_units_lab": "um" if complex_ else "mm/s",
            } | changes  # fmt: skip
            sets.append(pyuff.prepare_58(**kept))
    write_uff(path, sets)


def skinsource(path: Path, seed: int = 5) -> np.ndarray:
    """Values (522, 72, 3), in the order of MATLAB."""
    values = np.random.default_rng(seed).normal(size=(522, 72, 3)).astype("<f4")
    path.write_bytes(values.ravel(order="F").tobytes())
    return values


def zigzag(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Velocities (N, M, 2) that begin later at each place, and what they were before."""
    rng = np.random.default_rng(6)
    count, long = 4, 400
    begun = rng.normal(size=(count, long + 60, 2))
    pulse = np.exp(-(((np.arange(long + 60) - 150) / 6.0) ** 2))
    pulse += 1e-3 * rng.normal(size=long + 60)
    lag = rng.integers(0, 60, size=(count, 2))
    y, r = np.empty((count, long, 2)), np.empty((count, long, 2))
    for n, k in np.ndindex(count, 2):
        part = slice(lag[n, k], lag[n, k] + long)
        y[n, :, k], r[n, :, k] = begun[n, part, k], pulse[part]
    xyz = np.c_[np.arange(count) * 1e-2, np.zeros(count), np.ones(count)]
    savemat(path, {"y": y, "r": r, "fs": 5000.0, "xyz": xyz})
    return begun, lag
