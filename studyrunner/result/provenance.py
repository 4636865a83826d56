"""Origin of a result: attributes of the file, and a comparison of a result with the present scene and solver."""

import hashlib
import platform
from collections.abc import Iterator
from datetime import UTC, date, datetime
from importlib import metadata

from studyrunner.scene.scene import SceneFacts
from studyrunner.study.study import Study
from studyrunner.study.study_file import format_study
from studyrunner.system.machine import package_digest
from studyrunner.user_error import UserError

PACKAGES = ("fretwear", "numpy", "scipy", "numba", "xarray", "netCDF4", "h5py", "pydantic")

_REFERENCE = (
    "Salles et al.: Dynamic analysis of fretting-wear in joint interface by a multiscale harmonic"
    " balance method coupled with explicit or implicit integration schemes"
)
_COMMENT = (
    "SI units. A point is one combination of the axes (the dimensions before cycle or mission); outcome says how its"
    " computation ended; values that it did not reach are NaN, or 0 in whole numbers. Relative displacement is that of"
    " blade minus disk in the frame of the contact pair (normal, tangent 1, tangent 2), its normal component positive"
    " when the pair closes; contact forces and pressures are positive in compression. A complex amplitude X stands for"
    " x(t) = Re(X exp(i omega t)). Slow time is counted in vibration cycles, or in missions. Give this file to"
    " run-study to compute its study again."
)


def describe_run(study: Study, facts: SceneFacts) -> dict[str, str]:
    """Attributes that equal runs share, not of time, place or number of ranks; the id is a hash of all inputs."""
    text, solver = format_study(study), package_digest("solver")
    program = f"{PACKAGES[0]} {metadata.version(PACKAGES[0])}"
    return {
        "Conventions": "CF-1.11, ACDD-1.3",
        "title": study.study.title or study.study.name,
        "summary": _summarise(study, facts),
        "keywords": "fretting wear, contact, dry friction, vibration, harmonic balance",
        "id": hashlib.sha256("\n".join((text, facts.digest, solver)).encode()).hexdigest()[:32],
        "naming_authority": PACKAGES[0],
        "source": f"{program}: multiscale harmonic balance with wear on a slow time scale",
        "history": f"computed by run-study of {program} from the study in the attribute study",
        "references": _REFERENCE,
        "comment": _COMMENT,
        "processing_level": "model result, not processed further",
        "product_version": metadata.version(PACKAGES[0]),
        "kind": study.kind.name,
        "study": text,
        "versions": describe_versions(),
        "solver_digest": solver,
        "scene_sha256": facts.digest,
    }


def _summarise(study: Study, facts: SceneFacts) -> str:
    """Abstract in the sense of ACDD: quantities, scene and ranges of the study."""
    pairs = "one contact pair" if facts.contact.n_contact == 1 else f"{facts.contact.n_contact} contact pairs"
    ranges = [
        f"{name} {min(values):.6g} to {max(values):.6g} ({len(values)} values)"
        if all(isinstance(value, float | int) for value in values)
        else f"{name} {', '.join(map(str, values))}"
        for name, values in study.dimensions.items()
        if len(values) > 1
    ]
    over = f", over {'; '.join(ranges)}" if ranges else ""
    return study.kind.about.format(scene=f"{study.scene.model} with {pairs}{over}")


def describe_versions() -> str:
    """Versions of Python and of the packages that compute the result."""
    packages = [f"{name} {metadata.version(name)}" for name in PACKAGES]
    return ", ".join([f"Python {platform.python_version()}", *packages])


def compare_with_archived(study: Study, scene_sha256: str) -> Iterator[str]:
    """Why a study from a result file may have another result with a scene of this digest, as lines; none for others."""
    there, versions = study.archived, describe_versions()
    if there is None:
        return
    if there.scene_sha256 not in (None, scene_sha256):
        before = there.scene_sha256[:12] or "missing"
        yield f"its scene_sha256 is {before}, that of the scene built now {scene_sha256[:12]}: another scene"
    if there.solver_digest != package_digest("solver"):
        yield f"computed by another solver ({there.versions or 'unknown'}; now {versions}): numbers may differ"


def check_date(text: str, place: str, key: str) -> str:
    """A date, or date and time, in the extended form of ISO 8601, from any of its forms; "now": that of the call.

    place, key: where the input was given, for the message. Raises UserError where the text is neither.
    """
    text = datetime.now(UTC).isoformat(timespec="seconds") if text == "now" else text
    for kind in (date, datetime):
        try:
            return kind.fromisoformat(text).isoformat().replace("+00:00", "Z")
        except ValueError:
            continue
    remedy = 'give a date of ISO 8601, as 2026-11-23 or 2026-11-23T14:05:00Z, or "now"'
    raise UserError(place, key, text, remedy)
