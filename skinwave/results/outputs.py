"""Output folders and files: written under a name of their own beside the target, then renamed.

Names are new ones that no other process has, and nothing is removed or replaced but what this
program wrote. Whoever finishes first has the target's name; a run that finds there what was not
there when it began keeps its result beside it and says where.
"""

import contextlib
import errno
import json
import os
import secrets
import shlex
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, NoReturn

from skinwave.results import marks, record

LONGEST = 50  # characters of a name that a temporary one begins with
ATTEMPTS = 100  # at a name that is not taken, of 4e9
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
TAKEN = (errno.EEXIST, errno.ENOTEMPTY, errno.ENOTDIR, errno.ENOENT)  # of a rename to a new name
ELSEWHERE = (ConnectionError, TimeoutError, ChildProcessError)  # system errors of no file


class _Taken(Exception):
    """The target is no longer what it was when the writing began."""


@contextmanager
def output_folder(
    out: Path,
    *,
    overwrite: bool = False,
    inputs: Iterable[str | Path] = (),
    report: Sequence[str] = (),
) -> Iterator[Path]:
    """A folder to write in, which becomes `out` when all is written.

    Until then its name is `<out>.partial-` and eight digits. An error removes it, with the folders
    above that were made for it, and leaves what was there before untouched. An interrupt keeps it
    if it holds finished runs, and names the command that makes a report of them.

    Parameters
    ----------
    inputs : what the command reads, which is never replaced
    report : options of that command

    Raises
    ------
    ValueError
        If `out` exists and may not be overwritten, or cannot be written.
    KeyboardInterrupt
        With a sentence that names what is kept, if there is anything.
    """
    out = Path(os.path.realpath(out))  # a link stays one, and points to what is written
    _refuse_existing(out, overwrite, inputs)
    there, above, aside = _identity(out), list[Path](), None
    try:
        _make_parents(out.parent, above)
        aside = beside(out, Path.mkdir, f"{out.name[:LONGEST]}.partial-", "")
        yield aside
        marks.seal(aside)
        _put_in_place(aside, out, there)
    except _Taken:
        _refuse_taken(out, aside)
    except KeyboardInterrupt:
        if aside and any(aside.rglob(record.FILE)):
            _drop_unfinished(aside)
            raise KeyboardInterrupt(_kept(aside, report)) from None
        _remove(aside, above)
        raise
    except BaseException as error:
        _remove(aside, above)
        if isinstance(error, OSError):
            _refuse_unwritable(out, aside, error, "choose another --out")
        raise


@contextmanager
def output_path(
    out: Path, *, overwrite: bool = False, inputs: Iterable[str | Path] = ()
) -> Iterator[Path]:
    """The path of an empty file of the same kind, which becomes `out` when all is written; an
    error or an interrupt leaves no trace.

    Raises
    ------
    ValueError
        If `out` exists and may not be overwritten, is one of the `inputs` of the command, or
        cannot be written.
    """
    out = Path(os.path.realpath(out))
    _refuse_file(out, overwrite, inputs)
    aside = None
    try:
        aside = beside(out, _new_file, f".{out.stem[:LONGEST]}.partial-", out.suffix)
        yield aside
        _name_file(aside, out, overwrite)
    except _Taken:
        _refuse_taken(out, aside)
    except BaseException as error:
        with contextlib.suppress(OSError):
            if aside:
                aside.unlink()
        if isinstance(error, OSError):
            _refuse_unwritable(out, aside, error, "choose another")
        raise


@contextmanager
def output_file(
    out: Path, *, overwrite: bool = False, inputs: Iterable[str | Path] = ()
) -> Iterator[IO[bytes]]:
    """A file to write to, which becomes `out` as that of `output_path` does."""
    with output_path(out, overwrite=overwrite, inputs=inputs) as aside, open(aside, "wb") as file:
        yield file


def beside(out: Path, make: Callable[[Path], object], begin: str, end: str) -> Path:
    """A new path in the folder of `out`, with the permissions that new files have; `make` makes it
    and fails if it exists, be it a link.
    """
    with contextlib.suppress(FileNotFoundError):
        out.lstat()  # a name that is too long is refused now, not when all is written
    for _ in range(ATTEMPTS):
        path = out.with_name(f"{begin}{secrets.token_hex(4)}{end}")
        with contextlib.suppress(FileExistsError):
            make(path)
            return path
    raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path))


def _new_file(path: Path) -> None:
    os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))


def _refuse_existing(out: Path, overwrite: bool, inputs: Iterable[str | Path]) -> None:
    if out.exists() and marks.within(Path.cwd(), out):
        raise ValueError(f"{out} holds the current folder; choose another --out")
    if os.path.lexists(out) and not overwrite:
        raise ValueError(f"{out} exists and is kept; pass --overwrite or another --out")
    if os.path.lexists(out) and not out.is_dir():
        raise ValueError(f"{out} is a file; choose a folder with --out")
    if out.exists():
        marks.refuse_unmarked(out, inputs)


def _refuse_file(out: Path, overwrite: bool, inputs: Iterable[str | Path]) -> None:
    if not os.path.lexists(out):
        return
    if out.is_dir():
        raise ValueError(f"{out} is a folder; name a file or choose another")
    if not overwrite:
        raise ValueError(f"{out} exists and is kept; pass --overwrite or choose another")
    if not out.is_file():
        raise ValueError(f"{out} is no regular file; choose another")
    if any(os.path.exists(path) and os.path.samefile(path, out) for path in inputs):
        raise ValueError(f"{out} is read by this command; choose another")


def _refuse_taken(out: Path, aside: Path | None) -> NoReturn:
    raise ValueError(
        f"{out} was written or changed by another program meanwhile and is kept; this result is "
        f"{aside}, rename it as you like"
    ) from None


def _refuse_unwritable(out: Path, aside: Path | None, error: OSError, cure: str) -> None:
    """Say it of `out` if it is an error of writing there."""
    ours = (str(out.with_name(out.name[:LONGEST])), str(aside))
    other = error.filename is not None and not str(error.filename).startswith(ours)
    if not error.strerror or isinstance(error, ELSEWHERE) or (other and aside):
        return
    raise unwritable(out, error, cure) from error


def unwritable(out: Path, error: OSError, cure: str) -> ValueError:
    """The sentence that a folder or file cannot be written."""
    room = "make room there or " * (error.errno in FULL)
    return ValueError(f"{out} cannot be written ({error.strerror}); {room}{cure}")


def _drop_unfinished(aside: Path) -> None:
    """Leave finished runs and what was planned, which a page is made from, and no half of a file.

    The folder of a run appears whole, so that all in one with a record is.
    """
    runs = {path.parent for path in aside.rglob(record.FILE)}
    loose = [p for p in aside.rglob("*") if p.is_file() and not runs & {*p.parents}]
    for path in loose:
        if path.suffix != ".toml" and not _is_json(path):
            path.unlink()
    for folder in sorted((p for p in aside.rglob("*") if p.is_dir()), reverse=True):
        with contextlib.suppress(OSError):
            folder.rmdir()  # if it is empty


def _is_json(path: Path) -> bool:
    if path.suffix != ".json":
        return False
    try:
        json.loads(path.read_text(encoding="utf-8"))
    except ValueError:
        return False
    return True


def _kept(aside: Path, report: Sequence[str]) -> str:
    command = shlex.join(["skinwave", "report", str(aside), *report])
    return f"the runs that were finished are kept in {aside}; {command} makes a page of them"


def _identity(out: Path) -> tuple[int, int] | None:
    """Identity of a folder, which another of the same name has not; None if there is none."""
    if not os.path.lexists(out):
        return None
    mark = out / record.FILE
    return out.stat().st_ino, mark.stat().st_mtime_ns if mark.exists() else 0


def _make_parents(folder: Path, made: list[Path]) -> None:
    """Make what is missing of a folder; `made` is filled with what was, the innermost first."""
    for missing in reversed([p for p in (folder, *folder.parents) if not os.path.lexists(p)]):
        with contextlib.suppress(FileExistsError):
            missing.mkdir()
            made.insert(0, missing)


def _put_in_place(aside: Path, out: Path, there: tuple[int, int] | None) -> None:
    """Give what is written its name, unless the name has come to mean another folder."""
    now = _identity(out)
    if now is not None and (now != there or marks.foreign(out)):
        raise _Taken
    try:
        if now is None:
            aside.rename(out)
        else:
            _exchange(aside, out)
    except OSError as error:
        if error.errno in TAKEN:
            raise _Taken from None
        raise


def _exchange(aside: Path, out: Path) -> None:
    """Replace a folder; it is put back if that fails."""
    shutil.copymode(out, aside)
    kept = Path(tempfile.mkdtemp(prefix=f"{out.name[:LONGEST]}.replaced-", dir=out.parent))
    kept /= out.name
    try:
        out.rename(kept)
        aside.rename(out)
    except BaseException:
        if kept.exists() and not os.path.lexists(out):
            kept.rename(out)
        with contextlib.suppress(OSError):
            kept.parent.rmdir()
        raise
    _remove(kept.parent, ())


def _name_file(aside: Path, out: Path, overwrite: bool) -> None:
    """Give a file its name, over another only if that may be overwritten."""
    if overwrite:
        with contextlib.suppress(OSError):
            shutil.copymode(out, aside)
        os.replace(aside, out)
        return
    try:
        os.link(aside, out)  # which fails if there is one; a rename does not everywhere
    except FileExistsError:
        raise _Taken from None
    except (OSError, AttributeError):  # a disk without links
        if os.path.lexists(out):
            raise _Taken from None
        aside.rename(out)
    else:
        aside.unlink()


def _remove(aside: Path | None, above: Iterable[Path]) -> None:
    """A folder, and those above it that are empty then; no signal stops it halfway."""
    try:
        if aside:
            shutil.rmtree(aside, ignore_errors=True)
    except BaseException:  # SIGTERM is a SystemExit
        if aside:
            shutil.rmtree(aside, ignore_errors=True)
        raise
    finally:
        with contextlib.suppress(OSError):
            for folder in above:
                folder.rmdir()
