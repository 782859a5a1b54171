# The servers of the `scale` profile where their images cannot be had: PostgreSQL of the base's distribution, and the
# S3 server of the tests.
ARG BASE
FROM ${BASE}
ARG PIP_CERT
RUN apt-get update \
    && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends postgresql python3-venv ca-certificates \
    && rm -rf /var/lib/apt/lists/*
# constraints.txt is mounted there by the build.
RUN python3 -m venv /opt/moto && /opt/moto/bin/pip install --quiet --no-cache-dir --constraint /mnt/constraints.txt 'moto[s3]' flask flask-cors
COPY postgres.sh /usr/local/bin/postgres.sh
