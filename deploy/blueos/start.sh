#!/bin/sh
# Start `slz run` in the BlueOS extension, as the user slz. /data, which outlives the container, holds the state,
# the compiled kernels, and the tokens of the page, made at the first start.
set -eu
data=${SLZ_DATA:-/data}
install -d -o slz -g slz -m 0700 "$data" "$data/slz" "$data/cache"
if [ ! -s "$data/tokens" ]; then
    token() { od -An -N12 -tx1 /dev/urandom | tr -d ' \n'; }
    (umask 077; printf 'operator %s\nviewer   %s\n' "$(token)" "$(token)" > "$data/tokens")
    chown slz:slz "$data/tokens"
    echo "tokens of the page (kept in /usr/blueos/extensions/slz/tokens):"
    cat "$data/tokens"
fi
if [ $# = 0 ]; then
    # shellcheck disable=SC2086 # several options
    set -- run --mavlink "$SLZ_MAVLINK" --lidar "$SLZ_LIDAR" \
        --dashboard "$SLZ_PAGE" --dashboard-token "$data/tokens" $SLZ_OPTIONS
fi
nice=""
if setpriv --dump | grep -q 'Capability bounding set:.*sys_nice'; then
    nice="--inh-caps=+sys_nice --ambient-caps=+sys_nice"
fi
export HOME=/home/slz XDG_STATE_HOME="$data" NUMBA_CACHE_DIR="$data/cache"
# shellcheck disable=SC2086 # none or two options
exec setpriv --reuid=slz --regid=slz --init-groups $nice slz "$@"
