"""A flight compiled by numba-cuda: code for an H200 without one, and the same code run on the CPU."""

from __future__ import annotations

import re
import shutil
import subprocess

import numpy as np
import pytest

import device_cases
from flownav.campaigns.device_flight import take_here
from flownav.core.compile import equation
from flownav.core.compiling.device import compile_for_device
from flownav.core.compiling.launch import argument_names, argument_type, compiled, flattened, per_thread

pytest.importorskip("numba_cuda", reason="numba-cuda is not installed (extra gpu)")
pathfinder = pytest.importorskip("cuda.pathfinder", reason="numba-cuda is not installed (extra gpu)")

H200 = (9, 0)
MOST_REGISTERS, MOST_PARAMETER_BYTES = 255, 32_764  # of a thread; of a kernel from CUDA 12.1 on


@pytest.fixture(scope="module")
def hosted():
    """A device that runs on this processor what is compiled for an H200."""
    device_on_host = pytest.importorskip("device_on_host")
    try:
        return device_on_host.HostedDevice(take_here)
    except (ImportError, RuntimeError) as error:  # the compiler's own wheels are absent
        pytest.skip(f"NVIDIA's compiler is not installed: {error}")


class Recorder:
    """Stands before a device and keeps what it was asked to run."""

    in_python = False

    def __init__(self, device):
        self.device, self.put, self.new, self.fetch = device, device.put, device.new, device.fetch
        self.free_bytes = device.free_bytes

    def run(self, function, threads, told, constants):
        self.asked = function, (threads, *(told[name] for name in argument_names(function, constants))), constants
        self.device.run(function, threads, told, constants)


@pytest.fixture(scope="module")
def paper(hosted):
    """A whole flight of the paper's filter, scored, what was run, and the code for an H200 that it is."""
    recorder, setup = Recorder(hosted), device_cases.ready("landing", {"filter": {"name": "paper"}})
    rows = device_cases.on_device(recorder, setup, 5, False)
    function, arguments, constants = recorder.asked
    code = compile_for_device(per_thread(function, constants), tuple(map(argument_type, arguments)), H200)
    return setup, rows, arguments, code


@equation
def multiply_and_add(thread, threads, a, b, c, out):
    out[thread] = a[thread] * b[thread] + c[thread]


def test_a_product_and_a_sum_are_rounded_one_by_one(hosted):
    arguments = (1, *(np.zeros(1) for _ in range(4)))
    code = compile_for_device(per_thread(multiply_and_add, {}), tuple(map(argument_type, arguments)), H200)
    assert "mul.rn.f64" in code.ptx
    assert "add.rn.f64" in code.ptx
    assert "fma" not in code.ptx


def test_noise_is_the_cpu_s_to_the_last_bit(hosted):
    (words, normals), (told_words, told_normals) = device_cases.noise_on_device(hosted), device_cases.noise_on_cpu()
    assert np.array_equal(words, told_words)
    assert len(np.unique(words)) == words.size
    assert np.all(np.abs(normals - told_normals) <= np.spacing(np.abs(told_normals)))


def test_whole_flights_agree_with_the_cpu_to_a_billionth(paper):
    setup, rows, _, _ = paper
    told = device_cases.on_cpu(setup, 5, False)
    assert np.allclose(rows, told, rtol=1e-9, atol=1e-9, equal_nan=True)
    assert len(set(rows[:, 0])) == 5


def test_a_flight_is_machine_code_for_an_h200(paper):
    *_, code = paper
    assert ".target sm_90" in code.ptx
    assert code.cubin[:4] == b"\x7fELF"
    assert code.name.encode() in code.cubin


def test_arguments_are_handed_over_as_the_code_takes_them(paper):
    _, _, arguments, code = paper
    entry = code.ptx[code.ptx.index(f".entry {code.name}") :]
    takes = re.findall(r"\.param \.(?:align \d+ )?(\w+) ", entry[: entry.index(")")])
    sizes = {"u8": bool, "u64": int, "f64": float, "s64": int, "b64": int}
    given = list(flattened(arguments, lambda array: 1))
    assert [sizes[kind] for kind in takes] == list(map(type, given))
    assert sum(8 for _ in given) < MOST_PARAMETER_BYTES


def test_registers_and_spills_are_told(paper, tmp_path):
    assembler = pathfinder.find_nvidia_binary_utility("ptxas") or shutil.which("ptxas")
    if assembler is None:
        pytest.skip("NVIDIA's assembler is not installed")
    *_, code = paper
    (tmp_path / "flight.ptx").write_text(code.ptx)
    done = subprocess.run(
        [assembler, "-arch=sm_90", "-v", tmp_path / "flight.ptx", "-o", tmp_path / "flight.cubin"],
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    print("\n".join(line for line in done.stderr.splitlines() if "registers" in line or "spill" in line))
    registers = [int(number) for number in re.findall(r"Used (\d+) registers", done.stderr)]
    assert registers
    assert max(registers) <= MOST_REGISTERS


def test_code_is_kept_and_found_again(hosted, monkeypatch, tmp_path):
    from flownav.core.compiling import cache, launch

    monkeypatch.setattr(launch, "STORE", cache.Store(tmp_path, tmp_path / "none"))
    kinds = tuple(map(argument_type, (1, *(np.zeros(1) for _ in range(4)))))
    first = compiled(multiply_and_add, {}, kinds, H200)
    monkeypatch.setattr(launch, "compile_for_device", None)
    again = compiled(multiply_and_add, {}, kinds, H200)
    assert first.ptx
    assert (again.name, again.cubin) == (first.name, first.cubin)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "sections", "drawn"),
    [("landing", {}, False), ("gusty", {"filter": {"name": "paper"}}, True), ("approach", {}, True)],
    ids=["the navigator", "gusts on the paper's filter", "the approach, each its own truth"],
)
def test_other_whole_flights_agree_too(hosted, scenario, sections, drawn):
    setup = device_cases.ready(scenario, sections)
    rows, told = device_cases.on_device(hosted, setup, 4, drawn), device_cases.on_cpu(setup, 4, drawn)
    assert np.allclose(rows, told, rtol=1e-9, atol=1e-9, equal_nan=True)
