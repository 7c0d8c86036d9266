import os
import pickle
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import sim
from sim import jit
from sim.effects.sliders import coulomb

SIM = Path(sim.__file__).parent


def run(code: str, folder: Path, cache: Path) -> str:
    environment = {**os.environ, "PYTHONPATH": str(folder), "PADBENCH_CACHE_DIR": str(cache)}
    environment.pop("NUMBA_CACHE_DIR", None)
    done = subprocess.run([sys.executable, "-c", code], env=environment, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_an_edit_in_a_called_function_of_another_file_is_noticed(tmp_path: Path) -> None:
    """numba's own cache returns the old value here; the folder's name must change with the sources."""
    package = tmp_path / "sim"
    package.mkdir()
    (package / "__init__.py").write_text("")
    shutil.copy(SIM / "jit.py", package)
    callee = package / "callee.py"
    callee.write_text("from sim.jit import compiled\n@compiled('float64(float64)')\ndef f(x):\n    return 2.0 * x\n")
    (package / "caller.py").write_text(
        "from sim.jit import compiled\nfrom sim.callee import f\n"
        "@compiled('float64(float64)')\ndef g(x):\n    return f(x) + 1.0\n"
    )
    code = "from sim.caller import g; import sim; print(sim.__file__, g(10.0))"
    cache = tmp_path / "cache"
    assert run(code, tmp_path, cache).split() == [str(package / "__init__.py"), "21.0"]
    callee.write_text(callee.read_text().replace("2.0", "3.0"))
    assert run(code, tmp_path, cache).split()[1] == "31.0"
    assert len(list((cache / "padbench").iterdir())) == 2


def test_an_edit_beside_a_function_outside_of_sim_is_noticed_too(tmp_path: Path) -> None:
    (tmp_path / "one.py").write_text("from sim.jit import compiled\n@compiled('float64()')\ndef f():\n    return 2.0\n")
    (tmp_path / "two.py").write_text(
        "from sim.jit import compiled\nfrom one import f\n@compiled('float64()')\ndef g():\n    return f() + 1.0\n"
    )
    code = f"import sys; sys.path.insert(0, {str(SIM.parent)!r}); from two import g; print(g())"
    assert run(code, tmp_path, tmp_path / "cache") == "3.0"
    (tmp_path / "one.py").write_text((tmp_path / "one.py").read_text().replace("2.0", "5.0"))
    assert run(code, tmp_path, tmp_path / "cache") == "6.0"


def test_threads_that_compile_at_once_keep_to_the_cache_folder() -> None:
    """Searches compile in threads. One that left while another looked put numba's setting back under it, and compiled
    code came to lie in the working directory."""
    entered, left = threading.Event(), threading.Event()
    seen: list[str] = []

    def second() -> None:
        with jit._numba_cache(coulomb.python) as numba:
            entered.set()
            assert left.wait(10.0)
            seen.append(numba.config.CACHE_DIR)

    with jit._numba_cache(coulomb.python):
        thread = threading.Thread(target=second)
        thread.start()
        entered.wait(0.3)
    left.set()
    thread.join(10.0)
    assert seen == [str(jit.cache_folder())]


def test_compiled_code_is_read_back_by_the_next_process(tmp_path: Path) -> None:
    code = (
        "from sim.kernel import ramp_gain; ramp_gain(0.5); stats = ramp_gain.native.stats;"
        "print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))"
    )
    assert run(code, SIM.parent, tmp_path) == "0 1"
    assert run(code, SIM.parent, tmp_path) == "1 0"


def test_import_of_sim_loads_no_compiler() -> None:
    code = "import sim.model, sim.axis, sys; print('numba' in sys.modules or 'llvmlite' in sys.modules)"
    assert run(code, SIM.parent, Path("/nonexistent")) == "False"


def test_without_a_writable_cache_folder_a_private_one_is_used(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    code = (
        "import os; os.environ.pop('XDG_CACHE_HOME', None); os.environ['HOME'] = os.environ['PADBENCH_CACHE_DIR'];"
        f"os.environ['TMPDIR'] = {str(tmp_path)!r};"
        "from sim.jit import cache_folder; f = cache_folder(); print(f, oct(f.parent.stat().st_mode & 0o777))"
    )
    folder, mode = run(code, SIM.parent, blocked).split()
    assert Path(folder).is_relative_to(tmp_path)
    assert mode == "0o700"


def test_old_folders_go(tmp_path: Path) -> None:
    for age in range(jit.KEEP_FOLDERS + 4):
        marker = tmp_path / f"v{age:02d}" / "used"
        marker.parent.mkdir()
        marker.touch()
        when = marker.stat().st_mtime - 60.0 * age
        os.utime(marker, (when, when))
    kept = tmp_path / "v11"
    jit._prune(tmp_path, keep=kept)
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == [f"v{age:02d}" for age in range(jit.KEEP_FOLDERS)] + ["v11"]


def test_numbas_own_cache_folder_is_left_as_it_was() -> None:
    import numba

    before = numba.config.CACHE_DIR
    assert coulomb.address
    assert before == numba.config.CACHE_DIR


def test_the_python_form_of_a_block_runs_on_lists() -> None:
    state = [0.0, 0.0, 0.0]
    assert coulomb(0.001, 1.0, state, [0.05, 0.001]) == 0.0
    assert coulomb(0.001, 1.1, state, [0.05, 0.001]) == 0.05


def test_blocks_pickle_by_name() -> None:
    assert pickle.loads(pickle.dumps(coulomb)) is coulomb


def test_primitives_of_compiled_code_say_so() -> None:
    with pytest.raises(TypeError, match="compiled code only"):
        jit.call_block(0, 0.0, 0.0, [], 0, [], 0)
