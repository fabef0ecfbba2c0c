"""What is public is a good Python citizen: frozen, picklable, documented, thread-safe, quick to import."""

import copy
import pickle
import subprocess
import sys
import threading

import numpy as np
import pytest

import losnav as ln
from tests.api.calls import BODY, CALLS, COVARIANCE, GUESS, LANDMARKS, LOS, REFERENCE, SIGMA, same

RESULTS = {
    "solution": lambda: ln.solve_pose(LANDMARKS, LOS, sigma=SIGMA, guess=GUESS),
    "guess-free solution": lambda: ln.solve_pose(LANDMARKS[:4], LOS[:4], sigma=1e-4),
    "batch of solutions": lambda: ln.solve_pose(LANDMARKS, np.stack([LOS] * 3), sigma=SIGMA),
    "robust solution": lambda: ln.solve_pose_robust(LANDMARKS, LOS, sigma=SIGMA),
    "attitude": lambda: ln.solve_attitude(BODY, REFERENCE, sigma=SIGMA),
    "batch of attitudes": lambda: ln.solve_attitude(np.stack([BODY] * 3), REFERENCE, sigma=SIGMA),
    "robust attitude": lambda: ln.solve_attitude_robust(BODY, REFERENCE, sigma=SIGMA),
    "free attitude": lambda: ln.solve_attitude(BODY[:1], REFERENCE[:1]),
    "observability": lambda: ln.pose_observability(LANDMARKS, GUESS[:3]),
}


@pytest.mark.parametrize("name", RESULTS)
@pytest.mark.parametrize(
    "duplicate",
    [copy.copy, copy.deepcopy, *(lambda x, p=p: pickle.loads(pickle.dumps(x, p)) for p in range(2, 6))],
    ids=["copy", "deepcopy", "pickle 2", "pickle 3", "pickle 4", "pickle 5"],
)
def test_copies_and_pickles(name, duplicate):
    result = RESULTS[name]()
    twin = duplicate(result)
    assert type(twin) is type(result)
    assert same(twin, result)
    assert str(twin) == str(result)


@pytest.mark.parametrize("member", list(ln.Termination))
def test_termination_is_an_enumeration(member):
    assert pickle.loads(pickle.dumps(member)) is member
    assert {m.name.lower() for m in ln.Termination} >= {
        "gradient",
        "step",
        "cost",
    }


@pytest.mark.parametrize(
    "error",
    [
        ln.InvalidInputError,
        ln.DegenerateGeometryError,
        ln.UnobservableError,
        ln.NumericalError,
    ],
)
def test_errors(error):
    assert issubclass(error, ln.LosnavError)
    twin = pickle.loads(pickle.dumps(error("los[3]: expected a unit vector")))
    assert type(twin) is error
    assert str(twin) == "los[3]: expected a unit vector"


def test_invalid_input_is_a_value_error():
    assert issubclass(ln.InvalidInputError, ValueError)


@pytest.mark.parametrize("name", RESULTS)
def test_results_are_frozen(name):
    result = RESULTS[name]()
    field = "position" if "solution" in name else "rank"
    with pytest.raises((AttributeError, TypeError)):
        setattr(result, field, 0)


@pytest.mark.parametrize("name", RESULTS)
def test_results_read_well(name):
    text = str(RESULTS[name]())
    assert len(text) > 20
    assert "object at 0x" not in text
    assert "object at 0x" not in repr(RESULTS[name]())


def test_non_convergence_is_a_value():
    """One iteration from far away: no exception, no claim, a reason."""
    far = GUESS + np.array([60, -50, 90, 0.4, -0.3, 0.3])
    solution = ln.solve_pose(LANDMARKS, LOS, sigma=SIGMA, guess=far, max_iterations=1)
    assert not solution.converged
    assert solution.iterations <= 1
    termination = np.asarray(solution.termination).item()
    assert termination == ln.Termination.MAX_ITERATIONS


def test_singular_problems_are_a_value():
    """Landmarks on one line leave the rotation about it free: never converged, never an exception."""
    line = np.outer(np.arange(5.0), [1, 2, 0.5]) + np.array([3, 0, 0])
    position, mrp = np.array([2.0, -3, 40]), np.array([0.1, 0, 0.05])
    los = ln.predict_los(line, position, mrp)
    guessed = ln.solve_pose(line, los, sigma=1e-4, guess=np.append(position, mrp))
    assert not guessed.converged
    # Every other entry of a batch with such a member is as if alone.
    mixed = ln.solve_pose(np.stack([LANDMARKS[:5], line]), np.stack([LOS[:5], los]), sigma=1e-4, guess=GUESS)
    assert mixed.converged.tolist() == [True, False]


@pytest.mark.parametrize("name", CALLS)
def test_sixteen_threads(name):
    """The same call from sixteen threads at once gives what it gives alone."""
    expected = CALLS[name]()
    start = threading.Barrier(16)
    wrong = []

    def work():
        start.wait()
        for _ in range(20):
            if not same(CALLS[name](), expected):
                wrong.append(name)

    threads = [threading.Thread(target=work) for _ in range(16)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=60)
    assert not any(thread.is_alive() for thread in threads)
    assert not wrong


def test_sixteen_threads_share_one_solution():
    solution = ln.solve_attitude(np.stack([BODY] * 64), REFERENCE, sigma=SIGMA)
    assert_sixteen_threads_agree(solution, ("quaternion", "covariance", "dcm"))
    solution = ln.solve_pose(LANDMARKS, np.stack([LOS] * 64), sigma=SIGMA)
    assert_sixteen_threads_agree(solution, ("position", "covariance", "dcm"))


def assert_sixteen_threads_agree(solution, fields):
    expected = {field: np.array(getattr(solution, field)) for field in fields}
    start = threading.Barrier(16)
    wrong = []

    def work():
        start.wait()
        for _ in range(50):
            for field, value in expected.items():
                if not np.array_equal(getattr(solution, field), value):
                    wrong.append(field)

    threads = [threading.Thread(target=work) for _ in range(16)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=60)
    assert not wrong


@pytest.mark.parametrize("what", ["pose", "attitude"])
def test_solving_releases_the_interpreter(what):
    """While a large batch is solved in one thread, another one keeps running Python."""
    batch = np.broadcast_to(LOS, (40_000, *LOS.shape)).copy()
    done = threading.Event()

    def work():
        if what == "pose":
            ln.solve_pose(LANDMARKS, batch, sigma=SIGMA)
        else:
            ln.solve_attitude(batch, REFERENCE, sigma=SIGMA, method="svd")
        done.set()

    thread = threading.Thread(target=work)
    ticks = 0
    thread.start()
    while not done.is_set():
        ticks += 1
        done.wait(1e-4)
    thread.join()
    assert ticks > 3


def run_python(program):
    """Standard output of a fresh interpreter that turns every warning into an error."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    return done.stdout


def test_import_is_quick():
    """Below 0.15 s beyond NumPy; the best of five, because a busy machine is not the library's fault."""
    program = "import numpy, time; t = time.perf_counter(); import losnav; print(time.perf_counter() - t)"
    assert min(float(run_python(program)) for _ in range(5)) < 0.15


def test_import_does_nothing():
    """No warning, no output, no file beyond the modules themselves, no process, no socket, no thread."""
    program = """
import numpy, sys, threading
seen = []
def hook(event, arguments):
    if event in ("socket.connect", "subprocess.Popen", "os.system", "os.mkdir", "os.remove"):
        seen.append((event, arguments))
    if event == "open":
        path, mode, _ = arguments
        module = str(path).endswith((".py", ".pyc", ".so", ".pyd")) or "__pycache__" in str(path)
        if not module and not str(path).endswith("pyvenv.cfg"):
            seen.append((event, arguments))
sys.addaudithook(hook)
import losnav
assert not seen, seen
assert threading.active_count() == 1
assert not {"scipy", "matplotlib", "rich", "cv2", "filterpy"} & set(sys.modules), "extras are imported lazily"
"""
    assert not run_python(program)


def test_everything_public_is_documented():
    for name in ln.__all__:
        thing = getattr(ln, name)
        if not name.startswith("__"):
            assert (thing.__doc__ or "").strip(), name
    for name in ln.attitude.__all__:
        assert ">>>" in getattr(ln.attitude, name).__doc__, name


def test_covariance_is_symmetric_positive_definite():
    for solution in (RESULTS["solution"](), ln.solve_pose(LANDMARKS, LOS, covariance=COVARIANCE)):
        p = np.asarray(solution.covariance)
        assert np.array_equal(p, p.T)
        assert np.linalg.eigvalsh(p / np.sqrt(np.outer(np.diag(p), np.diag(p)))).min() > 0
