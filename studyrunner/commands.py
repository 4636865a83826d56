"""Where the commands begin: until they are loaded, a signal ends them without a traceback."""

from studyrunner.system.process import leave_endings


def run_study() -> int:
    """The command `run-study`; returns its exit status."""
    leave_endings()
    from studyrunner.cli import main

    return main()


def study_report() -> int:
    """The command `study-report`; returns its exit status."""
    leave_endings()
    from studyrunner.report.cli import main

    return main()
