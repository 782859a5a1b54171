# Any Debian-like base with glibc >= 2.35 and Python 3.11 or newer: another release, ubuntu:24.04, a mirror's copy, a digest.
ARG BASE=debian:12.11-slim

FROM ${BASE} AS builder
RUN apt-get update \
    && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends ca-certificates g++ python3-dev python3-venv \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /src
# Behind a mirror, or a proxy that inspects TLS: --build-arg PIP_INDEX_URL=..., --build-arg PIP_CERT=/path/in/the/base.
ARG PIP_INDEX_URL
ARG PIP_CERT
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_COMPILE=1
# Libraries first, so that a change of our code does not download them again. Each file that is downloaded has a hash
# in image/*.lock (`make lock` writes them), and nothing is built but our code.
COPY image/requirements.lock image/build.lock image/
RUN python3 -m venv /opt/cusp && python3 -m venv /opt/build \
    && /opt/cusp/bin/pip install --require-hashes --only-binary :all: --no-deps --requirement image/requirements.lock \
    && /opt/build/bin/pip install --require-hashes --only-binary :all: --requirement image/build.lock
COPY image/slim.sh image/
RUN image/slim.sh /opt/cusp
COPY LICENSE README.md CMakeLists.txt pyproject.toml ./
COPY pipeline pipeline
COPY service service
# What is in the image, in CycloneDX: /opt/cusp/sbom.cdx.json.
RUN PATH=/opt/build/bin:$PATH /opt/build/bin/pip wheel --quiet --no-build-isolation --no-deps --wheel-dir /wheels . \
    && /opt/cusp/bin/pip install --no-deps --no-index /wheels/*.whl \
    && /opt/cusp/bin/pip uninstall --yes --quiet pip setuptools \
    && /opt/build/bin/cyclonedx-py environment --output-reproducible --output-file /opt/cusp/sbom.cdx.json /opt/cusp/bin/python \
    && { /opt/cusp/bin/python -m compileall -q /opt/cusp/lib || true; } # some libraries ship files of other Pythons

FROM ${BASE} AS runtime
LABEL org.opencontainers.image.title="Cusp" \
      org.opencontainers.image.description="Register the scan of a 3D-printed part to its design, without manually picked points." \
      org.opencontainers.image.licenses="GPL-3.0-only"
# System libraries of the open3d and pymeshlab wheels. Without libopengl0, pymeshlab loads but silently lacks its
# meshing filters: hence the check below, and one at each start of the service. Pango, HarfBuzz and a font are for
# PDF reports; libseccomp confines jobs; the client of the S3
# store starts only with certificate authorities. The wheels link to GL and never draw with it: its drivers, and the compiler
# that those bring, are removed.
RUN apt-get update \
    && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends \
        ca-certificates libegl1 libgl1 libopengl0 libusb-1.0-0 \
        libpango-1.0-0 libpangoft2-1.0-0 libharfbuzz-subset0 fonts-dejavu-core libseccomp2 python3 \
    && rm -rf /var/lib/apt/lists/* /var/cache/apt /usr/lib/*/dri /usr/lib/*/libLLVM* /usr/lib/*/libz3.so* \
    && groupadd --gid 10001 cusp \
    && useradd --uid 10001 --gid cusp --no-create-home --home-dir /data --shell /usr/sbin/nologin cusp \
    && install --directory --owner cusp --group cusp --mode 0700 /data
COPY --from=builder /opt/cusp /opt/cusp
ENV PATH=/opt/cusp/bin:$PATH \
    PYTHONUNBUFFERED=1 \
    PYTHONDONTWRITEBYTECODE=1 \
    MPLCONFIGDIR=/tmp/matplotlib \
    CUSP_DATA_DIR=/data
USER 10001:10001
WORKDIR /data
RUN ["python", "-c", "import pipeline; pipeline.preload()"]

VOLUME /data
EXPOSE 8000
# For `cusp up` and `cusp api`. A `cusp worker` has no port: /readyz of the API tells whether it is alive.
HEALTHCHECK --interval=10s --timeout=5s --start-period=30s --retries=3 \
    CMD ["python", "-c", "import os, urllib.request; urllib.request.urlopen(f'http://127.0.0.1:{os.environ.get(\"CUSP_PORT\", \"8000\")}/readyz', timeout=4)"]
# In a container, every client is another machine. Without API keys (`cusp keys create`) the service refuses to start,
# unless CUSP_ALLOW_OPEN=1 states that the port is guarded (docker run -p 127.0.0.1:8000:8000).
ENV CUSP_HOST=0.0.0.0
STOPSIGNAL SIGTERM
ENTRYPOINT ["cusp"]
CMD ["up"]
