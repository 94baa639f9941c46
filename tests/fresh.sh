#!/usr/bin/env bash
# `make fresh`: clones the last commit into new Debian systems and runs the README's two commands there.
# Each system is a folder with what the README asks for and no more: Python with its venv module, make, and git to
# clone with. From this machine it has the name server, the certificates and pip's settings, so that it works behind a
# proxy. Needs root and debootstrap. FRESH names another folder than out/fresh (some gigabytes each, kept for a look).
set -euo pipefail
cd "$(dirname "$0")/.."
here=$PWD
fresh=${FRESH:-$here/out/fresh}
[ "$(id -u)" = 0 ] || { echo "make fresh makes systems in folders: run it as root"; exit 2; }
command -v debootstrap >/dev/null || { echo "make fresh needs debootstrap (Debian: apt install debootstrap)"; exit 2; }

settings=$(env | grep -E '^(PIP_|https?_proxy=|HTTPS?_PROXY=|SSL_CERT|REQUESTS_CA)' || true)

borrow() { # a path of this machine, in a system at the same place
    [ -e "$1" ] || return 0
    mkdir -p "$2$(dirname "$1")"
    cp -rL "$1" "$2$(dirname "$1")/"
}

one() {
    local release=$1 root=$fresh/$1
    mkdir -p "$fresh"
    [ -e "$root/.made" ] || {
        rm -rf "$root"
        debootstrap --variant=minbase --include=python3,python3-venv,make,git,ca-certificates "$release" "$root" >"$root.log"
        touch "$root/.made"
    }
    rm -rf "$root/root/slz"
    git clone --quiet "$here" "$root/root/slz"
    for path in /etc/resolv.conf /etc/ssl/certs/ca-certificates.crt /etc/pip.conf /etc/xdg/pip; do borrow "$path" "$root"; done
    # Its own name space of mounts and processes: nothing is left behind, whatever ends it.
    unshare --mount --pid --fork bash -euo pipefail -c '
        mount --rbind /dev "$0/dev" && mount -t proc proc "$0/proc" && mount -t tmpfs tmpfs "$0/tmp"
        exec chroot "$0" env -i HOME=/root LANG=C.UTF-8 PATH=/usr/sbin:/usr/bin:/sbin:/bin "${@:1}" \
            sh -c "cd /root/slz && python3 --version && make demo && make test"
    ' "$root" $settings
}

for release in "$@"; do
    one "$release" || { echo "make fresh: $release FAILED"; exit 1; }
    echo "make fresh: $release: both commands passed"
done
