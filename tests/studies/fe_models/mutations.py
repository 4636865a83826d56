"""Mutations of good files: what a damaged or hostile copy of them may look like."""

import random

_NUMBERS = (
    *("0", "-1", "1e999", "nan", "inf", "-inf", "1e-320", "99999999999999999999", "2147483648", "4294967296", "1_0"),
    *("", " ", "1.5", "0x10", "1.0D+400", "٣", "*", "**", ",,,,", '"', "=", "1e36", "9223372036854775807", "-0"),
)


def mutate(text: bytes, seed: int) -> bytes:
    """One of many damages, the same for the same seed."""
    chance = random.Random(seed)
    changed = bytearray(text)
    kind = chance.randrange(7)
    if kind == 0:
        return bytes(changed[: chance.randrange(len(changed))])
    if kind == 1:
        for _ in range(chance.randrange(1, 20)):
            changed[chance.randrange(len(changed))] = chance.randrange(256)
        return bytes(changed)
    lines = text.split(b"\n")
    at = chance.randrange(len(lines))
    if kind == 2:
        del lines[at : at + chance.randrange(1, 10)]
    elif kind == 3:
        lines.insert(at, lines[chance.randrange(len(lines))])
    elif kind == 4:
        other = chance.randrange(len(lines))
        lines[at], lines[other] = lines[other], lines[at]
    elif kind == 5:
        start = chance.randrange(len(changed))
        part = bytes(chance.randrange(256) for _ in range(chance.randrange(1, 200)))
        return bytes(changed[:start]) + part + bytes(changed[start:])
    else:
        for _ in range(chance.randrange(1, 4)):
            at = chance.randrange(len(lines))
            separator = chance.choice([b",", b" ", b".", b"="])
            fields = lines[at].split(separator)
            fields[chance.randrange(len(fields))] = chance.choice(_NUMBERS).encode()
            lines[at] = separator.join(fields)
    return b"\n".join(lines)
