"""Every command that writes: inputs, links, devices, pipes and foreign files stay as they are; exit status 2."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console
from rich.progress import Progress

from flownav.cli import main
from flownav.cli.output import by_reason, fitted, say, stages, table
from flownav.core.parameter_files import shipped
from flownav.core.record import Record
from replay_logs import log_of_flight
from ulog_files import ulog_of_flight


@pytest.fixture(scope="module")
def inputs(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("inputs")
    flown = log_of_flight(4.0)
    flown.write(folder / "log")
    (folder / "x.ulg").write_bytes(ulog_of_flight(flown.tables).bytes())
    Record({"kind": "fly"}).save(folder / "x.fnr")
    (folder / "settings.toml").write_text("# flownav\nflow_gain_x = 1.0\n")
    for name in ("px4flow_paper.toml", "landing.toml", "quad_450.toml"):
        (folder / name).write_bytes(b"# flownav\n" + shipped(name).read_bytes())
    scenario = 'flow_sensor = "px4flow_paper.toml"\n' + (folder / "landing.toml").read_text()
    (folder / "scenario.toml").write_text(scenario)
    (folder / "key").write_text("0" * 64)
    return folder


@pytest.fixture
def here(inputs, tmp_path, monkeypatch) -> Path:
    """A folder of inputs, in which commands run."""
    shutil.copytree(inputs, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def contents(folder: Path) -> dict[str, bytes | str]:
    """Every file as it is; links by where they lead, pipes and sockets by their mode."""
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() and not path.is_symlink() else
        f"{path.lstat().st_mode:o} {os.readlink(path) if path.is_symlink() else ''}"
        for path in folder.rglob("*")
    }  # fmt: skip


def complaint(capsys, monkeypatch, command: str) -> str:
    """The message on standard error of a command that is refused: one line, status 2, at once, and nothing changed."""
    before, begun = contents(Path.cwd()), time.process_time()
    monkeypatch.setattr(sys, "argv", ["flownav", *command.split()])
    with pytest.raises(SystemExit) as left:
        main()
    told = capsys.readouterr()
    assert left.value.code == 2, told.err
    assert told.out == ""
    assert told.err.count("\n") == 1, told.err
    assert time.process_time() - begun < 20.0
    assert contents(Path.cwd()) == before
    return told.err


@pytest.mark.parametrize("command", [
    "replay x.ulg --out x.ulg",
    "replay log --out log/attitude.csv",
    "replay log --out log/new.csv",
    "replay log --settings settings.toml --out settings.toml",
    "replay log --sensor px4flow_paper.toml --out px4flow_paper.toml",
    "fly scenario.toml --out scenario.toml",
    "fly scenario.toml --out px4flow_paper.toml",
    "fly landing --sensor px4flow_paper.toml --out px4flow_paper.toml",
    "fly landing --vehicle quad_450.toml --out quad_450.toml",
    "fly landing --signing-key key --out key",
    "live udp:14999 --record key --signing-key key",
    "live udp:14999 --record settings.toml --settings settings.toml",
    "identify log --out px4flow_paper.toml --base px4flow_paper.toml",
    "identify log --out log/rig.toml",
    "tune log --settings settings.toml --out settings.toml",
    "compare log x.ulg --out x.ulg",
    "compare log --with settings.toml --out settings.toml",
    "report x.fnr --out x.fnr",
    "export x.fnr --to ulog --merge x.ulg --out x.ulg",
    "envelope scenario.toml --out scenario.toml",
    "accuracy --vehicle quad_450.toml --out quad_450.toml",
    "validate --data log --out log/flow.csv",
])  # fmt: skip
def test_no_input_is_an_output(here, capsys, monkeypatch, command):
    said = complaint(capsys, monkeypatch, command)
    assert "would replace" in said or "which this run reads" in said


@pytest.mark.parametrize("command", [
    "replay log --out {}.fnr", "fly landing --out {}.fnr", "live udp:14999 --record {}.fnr",
    "identify log --out {}.toml", "identify log --for px4 --out {}.toml", "tune log --out {}.toml",
    "compare log --out {}.html", "report x.fnr --out {}.html",
    "export x.fnr --to ulog --out {}.ulg", "export x.fnr --to mcap --out {}.mcap", "export x.fnr --to csv --out {}.csv",
    "envelope landing --out {}.html", "accuracy --out {}.md", "validate --data log --out {}.md", "paper --out {}.html",
    "pad --out {}.toml", "pad --print {}.png", "rig --out {}.csv",
])  # fmt: skip
@pytest.mark.parametrize("kind", ["link", "fifo", "device"])
def test_no_output_goes_through_a_link_or_into_a_pipe_or_a_device(here, capsys, monkeypatch, command, kind):
    name = command.split("{}")[1].split()[0]
    path = Path(f"taken{name}")
    Path("target").write_text("mine\n")
    if kind == "fifo":
        os.mkfifo(path)
    else:
        path.symlink_to("target" if kind == "link" else "/dev/full")
    said = complaint(capsys, monkeypatch, command.format("taken"))
    assert "cannot be written" in said or "not a folder" in said


@pytest.mark.parametrize("command", ["replay log --out flight.fnr", "fly landing --out flight.fnr"])
def test_the_report_beside_a_record_is_an_output_too(here, capsys, monkeypatch, command):
    Path("flight.html").write_text("my page")
    said = complaint(capsys, monkeypatch, f"{command} --force")
    assert "flight.html: is there already and was not written by flownav" in said


@pytest.mark.parametrize("command", [
    "info {}", "replay {}", "compare {}", "tune {}", "identify {}", "report {}", "export {} --to csv",
    "flow {} --fps 1", "flow log --fps 1 --rates {}", "pad {} --focal 1", "fly {}", "fly landing --sensor {}",
    "fly landing --vehicle {}", "vehicle {}", "replay log --settings {}", "replay log --sensor {}",
    "live udp:14999 --signing-key {}",
])  # fmt: skip
def test_pipes_and_devices_are_not_read(here, capsys, monkeypatch, command):
    os.mkfifo("pipe.toml")
    assert "a FIFO (a named pipe) is not read" in complaint(capsys, monkeypatch, command.format("pipe.toml"))
    assert "a device is not read" in complaint(capsys, monkeypatch, command.format("/dev/zero"))


def test_names_that_are_no_text_are_names(here, capsysbinary, monkeypatch):
    """A folder and a record whose names are not UTF-8: read, written, shown, reported, as any other."""
    name = os.fsdecode(b"fl\xffight")
    Path("log").rename(name)
    record = f"{name}.fnr"
    for command in (
        ["info", name],
        ["replay", name, "--out", record],
        ["report", record, "--force"],
        ["export", record, "--to", "csv"],
        ["replay", name, "--json", "--force", "--out", record],
    ):
        monkeypatch.setattr(sys, "argv", ["flownav", *command])
        with pytest.raises(SystemExit) as left:
            main()
        told = capsysbinary.readouterr()
        said = [line for line in told.err.splitlines() if not line.startswith(b"flownav: compil")]
        assert (left.value.code, said) == (0, []), told.err
    assert Path(f"{name}.html").is_file()
    assert Record.load(Path(record)).manifest["kind"] == "replay"


@pytest.mark.parametrize("command", ["info", "replay", "report", "fly"])
def test_a_name_too_long_is_one_line(here, capsys, monkeypatch, command):
    assert "cannot be the name of a file" in complaint(capsys, monkeypatch, f"{command} {'x' * 300}.ulg")


def ended(monkeypatch, command: str) -> int:
    """The exit status of a command."""
    monkeypatch.setattr(sys, "argv", ["flownav", *command.split()])
    with pytest.raises(SystemExit) as left:
        main()
    return int(left.value.code)


def test_a_command_given_twice_numbers_its_output_and_says_so(here, capsys, monkeypatch):
    for name in ("log", "log-1"):
        assert ended(monkeypatch, "replay log --json") == 0
        told = capsys.readouterr()
        assert json.loads(told.out)["record"] == f"out/{name}.fnr"
        said = [line for line in told.err.splitlines() if "compil" not in line]
        assert said == ([] if name == "log" else [
            "flownav: out/log.fnr is there already (--force replaces it); writing out/log-1.fnr"
        ])  # fmt: skip
    names = ["log-1.fnr", "log-1.html", "log.fnr", "log.html"]
    assert sorted(path.name for path in Path("out").iterdir()) == names
    assert ended(monkeypatch, "replay log --json --force") == 0
    assert json.loads(capsys.readouterr().out)["record"] == "out/log.fnr"
    assert sorted(path.name for path in Path("out").iterdir()) == names


@pytest.mark.parametrize(("command", "name", "written"), [
    ("replay log --no-report --out my.fnr", "my.fnr", "my-1.fnr"),
    ("report x.fnr --out my.html", "my.html", "my-1.html"),
    ("sample dataflash --out .", "flight.bin", "flight-1.bin"),
    ("pad --print my.png", "my.png", "my-1.png"),
    ("rig --out my --duration 5", "my/notes.txt", "my-1/rig.csv"),
])  # fmt: skip
def test_what_is_there_is_kept_and_the_output_numbered(here, capsys, monkeypatch, command, name, written):
    Path(name).parent.mkdir(exist_ok=True)
    Path(name).write_text("mine\n")
    assert ended(monkeypatch, command) == 0
    told = capsys.readouterr()
    assert Path(name).read_text() == "mine\n"
    assert Path(written).stat().st_size > 100
    assert str(Path(written).parent if command.startswith("rig") else Path(written)) in told.out + told.err


@pytest.mark.parametrize("columns", [60, 80, 120, 400])
def test_a_table_fits_the_terminal_and_loses_nothing(columns):
    heads = ["fault", *(f"figure {k} [m]" for k in range(12)), "what was said of it"]
    rows = [[f"kind_{r}", *(f"{r * k / 7:.3f} ({k}-{r})" for k in range(12)), f"words_{r} " * 12] for r in range(5)]
    console = Console(width=columns, force_terminal=True, file=StringIO(), color_system=None)
    made = table(heads, rows, left=1, title="Many figures")
    made.columns[-1].justify = "left"
    parts = list(fitted(made, console))
    for part in parts:
        console.print(part)
    printed = console.file.getvalue()
    assert max(map(len, printed.splitlines())) <= columns
    assert (len(parts) == 1) is (columns == 400)
    assert printed.count("Many figures") == 1
    assert "…" not in printed
    for row in rows:
        assert all(printed.count(f" {cell} ") >= 1 for cell in row[1:-1])
        assert printed.count(f"words_{row[0][-1]}") == 12
    assert all(len(part.columns) > 1 for part in parts)
    assert {tuple(part.columns[0].cells) for part in parts} == {tuple(row[0] for row in rows)}


@pytest.mark.parametrize("columns", ["60", "80"])
def test_where_columns_says_how_wide_it_is_nothing_is_wider(columns, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", columns)
    rows = [["a cell of many words that may be broken", *(f"{k}.123 (0.045-0.067)" for k in range(6))]]
    say(table(["cell", *(f"figure {k} [m]" for k in range(6))], rows, left=1), "a line " * 30, wide=144)
    said = capsys.readouterr().out
    assert max(map(len, said.splitlines())) <= int(columns)
    assert all(f"{k}.123 (0.045-0.067)" in said for k in range(6))


def test_into_a_pipe_of_no_width_a_table_is_as_wide_as_it_asks(monkeypatch, capsys):
    monkeypatch.delenv("COLUMNS", raising=False)
    say(table(["cell", "figure"], [["a", "x" * 100]]), wide=144)
    assert "x" * 100 in capsys.readouterr().out


def test_names_that_share_a_reason_stand_in_one_line_in_the_order_of_the_reasons():
    pairs = [("a", "no GPS"), ("b", "no flow"), ("c", "no GPS")]
    assert by_reason(pairs) == [("a, c", "no GPS"), ("b", "no flow")]
    assert by_reason([]) == []


def test_a_stage_is_named_while_it_lasts_and_counts_when_the_next_begins(monkeypatch):
    bar = Progress(console=Console(file=StringIO()))
    monkeypatch.setattr("flownav.cli.output._bar", lambda: bar)
    shown = []
    with stages("Measuring", 3) as begin:
        for name in ("flights", "a replay", "help"):
            begin(name)
            shown.append((bar.tasks[0].description, bar.tasks[0].completed, bar.tasks[0].total))
    assert shown == [("Measuring flights", 0, 3), ("Measuring a replay", 1, 3), ("Measuring help", 2, 3)]


# -- no room -------------------------------------------------------------------------------------------------------
def without_room(tmp_path, *asked, most=4096, **to):
    """The one line of a command that may write no file larger than `most` bytes, run by itself."""
    limit = f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, ({most}, {most}))"
    run = f"{limit}; import sys; from flownav.__main__ import main; sys.argv = ['flownav', *{list(map(str, asked))!r}]"
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    done = subprocess.run(
        [sys.executable, "-c", f"{run}; main()"], cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True, **to
    )
    assert done.returncode == 2
    (line,) = done.stderr.strip().splitlines()
    return line


def test_a_full_disk_names_what_was_being_written(tmp_path):
    """As of a limit on a file's size, which fails as a full disk does: without a name."""
    certified = without_room(tmp_path, "certify", "approach", "--out", "c", most=64, stdout=subprocess.DEVNULL)
    assert certified == "flownav: c/campaign.json: File too large"


def test_a_full_disk_under_the_output_says_that_it_is_the_output(tmp_path):
    with Path("/dev/full").open("w") as output:
        assert without_room(tmp_path, "--help", stdout=output) == "flownav: the output: No space left on device"
