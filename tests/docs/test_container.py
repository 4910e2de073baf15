"""The Dockerfile and the development container: built where Docker is at hand; their steps also run without it."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from places import PROJECT

DOCKERFILE = (PROJECT / "Dockerfile").read_text(encoding="utf-8")
DEVELOP = json.loads((PROJECT / ".devcontainer" / "devcontainer.json").read_text(encoding="utf-8"))
OF_THE_SYSTEM = ("apt-get ", "mkdir /work && useradd ")  # steps that only a container may take


def stages() -> dict[str, list[tuple[str, str]]]:
    """Each stage's instructions, word and rest, by its name; the last has none."""
    found: dict[str, list[tuple[str, str]]] = {}
    for line in DOCKERFILE.splitlines():
        word, _, rest = line.partition(" ")
        if word == "FROM":
            found[rest.partition(" AS ")[2]] = own = [(word, rest)]
        elif line and word != "#":
            own.append((word, rest))
    return found


def words_of(word: str) -> list[str]:
    return [rest for name, rest in stages()[""] if name == word]


def test_the_development_container_is_a_stage_that_has_what_make_needs():
    build = DEVELOP["build"]
    assert (PROJECT / ".devcontainer" / build["dockerfile"]).resolve() == PROJECT / "Dockerfile"
    assert (PROJECT / ".devcontainer" / build["context"]).resolve() == PROJECT
    steps = " ".join(rest for word, rest in stages()[build["target"]] if word == "RUN")
    assert {"git", "make", "chromium"} <= set(steps.split())


def test_what_the_development_container_runs_is_there():
    makefile = (PROJECT / "Makefile").read_text(encoding="utf-8")
    groups = re.search(r"\[dependency-groups\]\n(.*?)\n\n", (PROJECT / "pyproject.toml").read_text(), re.S)
    command = DEVELOP["postCreateCommand"]
    assert "$(VENV)/.ready-%:" in makefile
    assert groups is not None
    for group in re.findall(r"\.ready-(\w+)", command):
        assert re.search(rf"^{group} = ", groups[1], re.M), group
    assert command.split(" && ")[1].startswith(".venv/bin/flownav ")


def test_the_stages_stand_on_a_python_that_flownav_takes():
    minimum = re.search(r'requires-python = ">=3\.(\d+)"', (PROJECT / "pyproject.toml").read_text(encoding="utf-8"))
    assert minimum is not None
    for instructions in stages().values():
        image = re.fullmatch(r"python:3\.(\d+)-slim", instructions[0][1].partition(" AS ")[0])
        assert image is not None
        assert int(image[1]) >= int(minimum[1])


def test_extras_that_the_image_installs_are_flownavs():
    (asked,) = re.findall(r"/flownav\[([a-z,]+)\]", DOCKERFILE)
    project = (PROJECT / "pyproject.toml").read_text(encoding="utf-8")
    for extra in asked.split(","):
        assert re.search(rf"^{extra} = \[", project, re.M), extra


def test_nothing_that_was_made_here_goes_into_the_image():
    ignored = (PROJECT / ".dockerignore").read_text(encoding="utf-8").split()
    known = [line.strip("/") for line in (PROJECT / ".gitignore").read_text(encoding="utf-8").split()]
    assert {name for name in known if "*" not in name} <= {name.removeprefix("**/") for name in ignored}
    assert ".git" in ignored


@pytest.mark.slow
def test_the_images_steps_give_a_command_that_flies(tmp_path):
    """The steps of the last stage, in a fresh environment: those of the system apart, which need a container."""
    source, work, place = tmp_path / "flownav", tmp_path / "work", tmp_path / "image"
    ignored = shutil.ignore_patterns(
        *(PROJECT / ".dockerignore").read_text(encoding="utf-8").replace("**/", "").split()
    )
    shutil.copytree(PROJECT, source, ignore=ignored)
    work.mkdir()
    subprocess.run([sys.executable, "-m", "venv", str(place)], check=True)
    outside = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "FLOWNAV_LEVEL")}
    outside |= {"PATH": f"{place / 'bin'}:{os.environ['PATH']}", "HOME": str(work)}

    def run(step: str) -> str:
        command = step.replace("/tmp/", f"{tmp_path}/").replace("/flownav", str(source))
        done = subprocess.run(["sh", "-c", command], env=outside, cwd=work, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{step}\n{done.stderr}"
        return done.stdout

    assert words_of("COPY") == [". /flownav"]
    steps = words_of("RUN")
    assert [step for step in steps if step.startswith(OF_THE_SYSTEM)] == steps[1:2]
    for step in steps:
        if not step.startswith(OF_THE_SYSTEM):
            run(step)
    (entry,), (arguments,) = (map(json.loads, words_of(word)) for word in ("ENTRYPOINT", "CMD"))
    assert run(shlex.join([*entry, *arguments])).startswith("Landed ")
    assert (work / "sortie.fnr").is_file()
    assert (work / "sortie.html").is_file()
    assert "compil" not in run(shlex.join([*entry, *arguments, "--force", "2>&1"]).replace("'2>&1'", "2>&1"))
    assert Path(run("command -v flownav").strip()) == place / "bin" / "flownav"


# -- with Docker -----------------------------------------------------------------------------------------------------
IMAGE = "flownav-of-the-tests"


def docker(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["docker", *words], capture_output=True, text=True, check=False)


@pytest.fixture
def daemon() -> None:
    if shutil.which("docker") is None or docker("info").returncode:
        pytest.skip("Docker's daemon is not here: the tests above check the Dockerfile and run its steps without it")


@pytest.mark.slow
def test_docker_builds_the_image_which_flies_and_the_stage_of_the_development_container(daemon, tmp_path):
    stage = docker("build", "--target", DEVELOP["build"]["target"], str(PROJECT))
    assert stage.returncode == 0, stage.stderr
    image = docker("build", "--tag", IMAGE, str(PROJECT))
    assert image.returncode == 0, image.stderr
    tmp_path.chmod(0o777)  # the image's user is another than the one who tests
    flown = docker("run", "--rm", "--volume", f"{tmp_path}:/work", IMAGE)
    docker("rmi", IMAGE)
    assert flown.returncode == 0, flown.stderr
    assert "verdict" in flown.stdout.lower()
    assert (tmp_path / "sortie.fnr").is_file()
