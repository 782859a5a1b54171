#!/bin/sh
# As the official image: the user POSTGRES_USER with its password and database, reached by password only.
set -eu
bin=$(ls -d /usr/lib/postgresql/*/bin)
data=/var/lib/postgresql/data
: "${POSTGRES_PASSWORD:?}"
chown postgres "$data"
printf %s "$POSTGRES_PASSWORD" > /tmp/password
chown postgres /tmp/password
run() { su postgres -s /bin/sh -c "$1"; }
[ -e "$data/PG_VERSION" ] || run "$bin/initdb -D $data -U $POSTGRES_USER --pwfile=/tmp/password -A scram-sha-256 -E UTF8 --no-sync"
echo "host all all all scram-sha-256" >> "$data/pg_hba.conf"
run "$bin/pg_ctl -D $data -w start -o '-c listen_addresses= -k /tmp'"
run "PGPASSWORD=$POSTGRES_PASSWORD $bin/createdb -h /tmp -U $POSTGRES_USER $POSTGRES_USER" || true
run "$bin/pg_ctl -D $data -w stop"
exec su postgres -s /bin/sh -c "exec $bin/postgres -D $data -c listen_addresses='*' -k /tmp"
