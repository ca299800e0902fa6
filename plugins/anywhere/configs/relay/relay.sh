#!/bin/sh
# Start coturn with the secret from a file: on a command line every user of the host could read it.
#
#   RUNTIME_DIRECTORY=FOLDER relay.sh SECRET_FILE [OPTION OF turnserver ...]
#
# FOLDER is for this service alone; the configuration with the secret is written there.
set -eu
umask 077
secret=$(cat "$1")
shift
case $secret in
    *[![:graph:]]*) echo "relay.sh: the file of the secret holds something else than one word" >&2; exit 2 ;;
esac
if [ "${#secret}" -lt 16 ]; then
    echo "relay.sh: the secret is shorter than 16 characters" >&2
    exit 2
fi
file=${RUNTIME_DIRECTORY:?names the folder for the configuration}/turnserver.conf
{ cat "$(dirname "$0")/turnserver.conf"; echo "static-auth-secret=$secret"; } > "$file"
exec turnserver -c "$file" --pidfile=/dev/null "$@"
