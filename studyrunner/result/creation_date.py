"""The date of creation in a result; only on request, so that equal runs have equal files."""

from __future__ import annotations

from datetime import UTC, date, datetime

from studyrunner.user_error import UserError

NOW = "now"
"""Stands for the time at which the file is written."""


def check_date(text: str, place: str, key: str) -> str:
    """A date, or date and time, in the extended form of ISO 8601, from any of its forms; or `NOW`.

    place, key: where the input was given, for the message. Raises UserError where the text is neither.
    """
    if text == NOW:
        return NOW
    for kind in (date, datetime):
        try:
            return kind.fromisoformat(text).isoformat().replace("+00:00", "Z")
        except ValueError:
            continue
    remedy = f'give a date of ISO 8601, as 2026-11-23 or 2026-11-23T14:05:00Z, or "{NOW}"'
    raise UserError(place, key, text, remedy)


def describe_date(checked: str | None) -> dict[str, str]:
    """Attribute of the file, in UTC for `NOW`; none without date."""
    if checked == NOW:
        checked = datetime.now(UTC).replace(microsecond=0, tzinfo=None).isoformat() + "Z"
    return {} if checked is None else {"date_created": checked}
