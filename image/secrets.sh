#!/bin/sh
# Makes the passwords of the `scale` profile, once: a file for each party, readable by you only.
set -eu
umask 077
cd "$(dirname "$0")/.."
if [ -e secrets ]; then
    echo "secrets/ exists and is kept; remove it to make new passwords, which the servers' data would not know"
    exit 0
fi
password() { od -An -N24 -tx1 /dev/urandom | tr -d ' \n'; }
postgres=$(password) store=$(password)
mkdir secrets
echo "POSTGRES_PASSWORD=$postgres" > secrets/postgres.env
echo "MINIO_ROOT_PASSWORD=$store" > secrets/store.env
echo "MC_HOST_store=http://cusp:$store@store:9000" > secrets/bucket.env
{
    echo "CUSP_DATABASE_URL=postgresql://cusp:$postgres@postgres/cusp"
    echo "AWS_SECRET_ACCESS_KEY=$store"
} > secrets/service.env
echo "wrote secrets/"
