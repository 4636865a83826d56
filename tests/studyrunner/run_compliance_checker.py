"""Runs compliance-checker on a file without a network and prints what it says as JSON: as it is, and mended.

A process of its own: the checker is not free of warnings, and it would ask the network for tables that it lacks.

Two of its faults cannot be helped by what is in a file:

- Whatever UDUNITS converts to bar makes a coordinate a vertical one (`get_z_variables`). UDUNITS converts reciprocals
  as well, so that 1/Pa, in all its forms, is taken for a pressure; CF (4.3) means units of pressure. No attribute of CF
  says that a coordinate is on no axis, and `axis`, the only one that goes before the units, knows T, Z, Y and X.
- A coordinate variable is numeric (CF 1.2), but `get_coordinate_variables` takes a variable of texts with the name of
  its dimension for one, too, and `check_coordinate_variables_strict_monotonicity` breaks off as it subtracts texts.
"""

import json
import socket
import sys
from collections.abc import Callable
from typing import Any

from cf_units import Unit
from compliance_checker.cf import cf_1_6, cf_base, util
from compliance_checker.suite import CheckSuite


def refuse(*_: object, **__: object) -> None:
    raise OSError("no network in tests")


def mend() -> None:
    """Puts the two faults right."""
    convertible: Callable[[str, str], bool] = util.units_convertible
    coordinates: Callable[[Any], list[str]] = util.get_coordinate_variables

    def not_by_reciprocals(first: str, second: str) -> bool:
        if not convertible(first, second):
            return False
        # twice as much is twice as much, where there is no origin in between as with temperatures and dates
        one, two, three = (Unit(first).convert(number, Unit(second)) for number in (1.0, 2.0, 3.0))
        return bool(abs((three - two) - (two - one)) <= 1e-9 * abs(two - one))

    def numeric(dataset: Any) -> list[str]:
        return [name for name in coordinates(dataset) if dataset.variables[name].dtype is not str]

    util.units_convertible, util.get_coordinate_variables = not_by_reciprocals, numeric
    for module in (cf_base, cf_1_6):
        for name, mended in (("units_convertible", not_by_reciprocals), ("get_coordinate_variables", numeric)):
            if hasattr(module, name):
                setattr(module, name, mended)


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
    as_it_is = report(sys.argv[1])
    mend()
    print(json.dumps({"as_it_is": as_it_is, "mended": report(sys.argv[1])}))
