"""Whatever is timed or run side by side has its linear algebra in one thread, as the commands have it."""

import os
import subprocess
import sys

import pytest

from bench.one_thread import ONE_THREAD

SAY = f"import os; print([os.environ.get(name) for name in {list(ONE_THREAD)}])"


@pytest.mark.parametrize(
    "first", ["from bench.cli import main; main(['--version'])", "import tests.benchmarks", "import tests.conftest"]
)
@pytest.mark.parametrize("given", [{}, {"OMP_NUM_THREADS": "2"}])
def test_one_thread_unless_the_environment_says_otherwise(first, given):
    kept = {name: value for name, value in os.environ.items() if name not in ONE_THREAD}
    words = [sys.executable, "-c", f"{first}; {SAY}"]
    said = subprocess.run(words, env=kept | given, capture_output=True, text=True, check=True).stdout
    assert said.splitlines()[-1] == str([given.get(name, "1") for name in ONE_THREAD])
