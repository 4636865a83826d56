"""The date of creation in a result; only on request, so that equal runs have equal files."""

from __future__ import annotations

from datetime import UTC, date, datetime

from studyrunner.user_error import UserError

NOW = "now"
"""Stands for the time at which the file is written."""


def check_date(text: str, place: str, key: str) -> str:
    """The date in the extended form of ISO 8601, or `NOW`.

    Parameters
    ----------
    text
        Input of the user: a date, or date and time, in any form of ISO 8601; or `NOW`.
    place, key
        Where the input was given, for the message.

    Raises
    ------
    UserError
        Where the text is neither.
    """
    if text == NOW:
        return NOW
    try:
        return date.fromisoformat(text).isoformat()
    except ValueError:
        pass
    try:
        return _extended(datetime.fromisoformat(text))
    except ValueError:
        remedy = f'give a date of ISO 8601, as 2026-11-23 or 2026-11-23T14:05:00Z, or "{NOW}"'
        raise UserError(place, key, text, remedy) from None


def describe_date(checked: str | None) -> dict[str, str]:
    """Attribute of the file, in UTC for `NOW`; none without date."""
    if checked is None:
        return {}
    return {"date_created": _extended(datetime.now(UTC).replace(microsecond=0)) if checked == NOW else checked}


def _extended(moment: datetime) -> str:
    return moment.isoformat().replace("+00:00", "Z")
