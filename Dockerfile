# flownav in one command, its kernels compiled:
#   docker build --tag flownav . && docker run --rm --volume "$PWD:/work" flownav fly --out sortie.fnr
# The stage `develop` is what .devcontainer opens. tests/docs/test_container.py runs the steps below without Docker.

FROM python:3.11-slim AS develop
RUN apt-get update && apt-get install --yes --no-install-recommends chromium git make && rm -rf /var/lib/apt/lists/*

FROM python:3.11-slim
COPY . /flownav
RUN python -m pip install --no-cache-dir --constraint /flownav/constraints.txt "/flownav[compile,live,mcap,pictures,plots]"
RUN mkdir /work && useradd --create-home --uid 1000 pilot && chown pilot /work
USER pilot
WORKDIR /work
# the first flight compiles: for this machine, and for any x86-64 of the last ten years
RUN flownav fly --no-report --out /tmp/first.fnr
RUN test "$(uname -m)" != x86_64 || FLOWNAV_LEVEL=x86-64-v3 flownav fly --no-report --force --out /tmp/first.fnr
ENTRYPOINT ["flownav"]
CMD ["fly", "--out", "sortie.fnr"]
