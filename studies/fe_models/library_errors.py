"""What other libraries do with a file that they cannot read, as one sentence."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from pathlib import Path

from studies.fe_models.text import check_file
from studies.scene_error import SceneError

_LARGEST_FILE = 2**31
_LONGEST_REASON = 160


@contextlib.contextmanager
def library_errors(path: Path, library: str, package: str, key: str) -> Iterator[None]:
    """A block that loads a library and has it read a file; what the library prints is not shown.

    library, package: name of the module, and of the package that brings it. key: what errors are about. Raises
    SceneError where the file is missing or too large, the library is not there, or cannot read the file.
    """
    check_file(path, _LARGEST_FILE, key)
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            yield
    except SceneError:
        raise
    except ImportError as error:
        if error.name is not None and f"{library}.".startswith(f"{error.name}."):
            found = f"{path.name} needs the library {library}, which is not installed"
            raise SceneError(key, found, f"install the library: pip install {package}") from None
        found = f"the library that reads {path.name} does not load: {error}"
        raise SceneError(key, found, "install it again, with what it needs") from None
    # the libraries raise anything for a file that they do not understand, and meshio calls sys.exit
    except (Exception, SystemExit) as error:
        reason = said.getvalue() if isinstance(error, SystemExit) else str(error)
        clean = "".join(each if each.isprintable() else "?" for each in " ".join(reason.split()))
        shown = f" ({clean[:_LONGEST_REASON]})" if clean else ""
        found = f"{path.name} is damaged, or of a kind that {library} does not know{shown}"
        raise SceneError(key, found, "write it again") from error
