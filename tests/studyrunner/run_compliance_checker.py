"""Runs compliance-checker on a file without a network and prints as JSON what it says.

A process of its own: the checker is not free of warnings, and it would ask the network for tables that it lacks.
"""

import json
import socket
import sys

from compliance_checker.suite import CheckSuite


def refuse(*_: object, **__: object) -> None:
    raise OSError("no network in tests")


def report(path: str) -> dict[str, object]:
    """Complaints as (checker, weight, name, message), 3 the heaviest; and the checks that broke off themselves."""
    suite = CheckSuite()
    dataset = suite.load_dataset(path)
    found: list[tuple[str, int, str, str]] = []
    broken: dict[str, str] = {}
    n_checks = 0
    for checker, (results, errors) in suite.run_all(dataset, ["cf:1.11", "acdd:1.3"]).items():
        broken.update({name: str(error) for name, (error, *_) in errors.items()})
        pending = list(results)
        while pending:
            result = pending.pop()
            pending.extend(result.children)
            n_checks += 1
            passed, wanted = result.value if isinstance(result.value, tuple) else (bool(result.value), True)
            if passed == wanted:
                # what it says then is no complaint
                continue
            found.extend((checker, result.weight, str(result.name), message) for message in result.msgs or ())
    return {"complaints": sorted(set(found)), "broken": broken, "n_checks": n_checks}


if __name__ == "__main__":
    socket.socket.connect = refuse  # type: ignore[method-assign]
    socket.getaddrinfo = refuse
    CheckSuite.load_all_available_checkers()
    print(json.dumps(report(sys.argv[1])))
