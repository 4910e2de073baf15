"""Reading a .tlog: flownav's whole reader beside pymavlink's own loop, which only decodes.

Run with `python -m pytest benchmarks/test_bench_mavlink.py --benchmark-only`; the file is made here, 40 s of flight.
"""

from __future__ import annotations

import pytest

from flownav.logs.mavlink_log import read_tlog
from mavlink_logs import flight_log


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = flight_log(40.0).write(tmp_path_factory.mktemp("mavlink") / "flight.tlog")
    print(f"{path.stat().st_size / 1e6:.2f} MB")
    return path


@pytest.mark.benchmark(group="a .tlog of 40 s")
def test_read_tlog(benchmark, path):
    assert read_tlog(path).streams
    benchmark.extra_info["MB"] = path.stat().st_size / 1e6
    benchmark(read_tlog, path)


@pytest.mark.benchmark(group="a .tlog of 40 s")
def test_pymavlink(benchmark, path):
    from pymavlink import mavutil

    def decode_all() -> int:
        log = mavutil.mavlogfile(str(path))
        count = 0
        while log.recv_msg() is not None:
            count += 1
        log.close()
        return count

    assert benchmark(decode_all) > 4000
