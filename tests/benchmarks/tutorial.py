"""All commands of the tutorial as printed, in an empty folder: about three CPU minutes.

python -m tests.benchmarks.tutorial
"""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

PAGE = Path(__file__).parents[2] / "studyrunner" / "TUTORIAL.md"


def main() -> None:
    environment = {**os.environ, "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])}
    with tempfile.TemporaryDirectory() as folder:
        for language, text in re.findall(r"^```(\w+)\n(.*?)^```$", PAGE.read_text("utf-8"), re.M | re.S):
            if language == "toml":
                name = re.search(r'name = "(\w+)"', text)[1]
                Path(folder, f"{name}.toml").write_text(text, encoding="utf-8")
                continue
            program = ["bash", "-e", "-x", "-c"] if language == "sh" else [sys.executable, "-c"]
            subprocess.run([*program, text], cwd=folder, env=environment, check=True)
        print(*sorted(path.name for path in Path(folder).iterdir()))


if __name__ == "__main__":
    main()
