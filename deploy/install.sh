#!/usr/bin/env bash
# Install slz as a service on Debian, Raspberry Pi OS or Ubuntu: run it as root from a checkout. Safe to run
# again: it brings everything up to date and keeps /etc/slz.
#
#   sudo deploy/install.sh                 everything
#   sudo EXTRAS=page,record,ros deploy/install.sh   with other extras (docs/install.md); page and record by default
#   deploy/install.sh --root DIR           files only, below DIR (to build an image, or to look at them)
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
root=""
case "${1:-}" in
    "") [ "$(id -u)" = 0 ] || { echo "install.sh: run it as root: sudo deploy/install.sh" >&2; exit 2; } ;;
    --root) root=${2:-}; [ -n "$root" ] || { echo "install.sh: --root needs a folder" >&2; exit 2; } ;;
    *) echo "install.sh: $1 is not known: write no argument, or --root DIR" >&2; exit 2 ;;
esac

python=${PYTHON:-python3}
enough='import sys; sys.exit(sys.version_info < (3, 11))'
if [ -z "$root" ]; then
    command -v "$python" > /dev/null \
        || { echo "install.sh: there is no $python: sudo apt install python3-venv, or name one: sudo PYTHON=python3.11 $0" >&2; exit 2; }
    "$python" -c "$enough" \
        || { echo "install.sh: $python is older than 3.11: install a newer one and name it: sudo PYTHON=python3.11 $0" >&2; exit 2; }
    "$python" -c 'import ensurepip, venv' 2> /dev/null \
        || { echo "install.sh: $python cannot make a virtual environment: sudo apt install $(basename "$python")-venv" >&2; exit 2; }
fi

put() {  # put MODE SOURCE TARGET
    if ! cmp -s "$2" "$root$3"; then
        install -D -m "$1" "$2" "$root$3"
        echo "wrote $3"
    fi
}

put 0644 "$here/deploy/slz.service" /etc/systemd/system/slz.service
put 0644 "$here/deploy/60-slz.rules" /etc/udev/rules.d/60-slz.rules
put 0644 "$here/deploy/60-slz-sysctl.conf" /etc/sysctl.d/60-slz.conf
put 0755 "$here/deploy/slz-doctor" /usr/local/sbin/slz-doctor
if [ ! -e "$root/etc/slz/slz.env" ]; then
    put 0640 "$here/deploy/slz.env" /etc/slz/slz.env
fi
if [ -n "$root" ]; then
    exit 0
fi

if ! getent passwd slz > /dev/null; then
    useradd --system --home-dir /var/lib/slz --shell /usr/sbin/nologin --groups dialout slz
    echo "made the user slz"
fi
chown root:slz /etc/slz /etc/slz/slz.env
chmod 0750 /etc/slz

install -d /opt/slz
for part in companion slz params sitl docs pyproject.toml constraints.txt README.md LICENSE NOTICE; do
    rm -rf "/opt/slz/$part"
    cp -r "$here/$part" "/opt/slz/$part"
done
if ! /opt/slz/.venv/bin/python -c "import pip; $enough" 2> /dev/null; then
    rm -rf /opt/slz/.venv
    "$python" -m venv /opt/slz/.venv
fi
rm -rf /opt/slz/build /opt/slz/slz.egg-info  # of the last version: a module deleted since would be installed again
echo "installing packages, about 150 MB"
/opt/slz/.venv/bin/python -m pip install --quiet --constraint /opt/slz/constraints.txt "/opt/slz[${EXTRAS:-page,record}]" || {
    echo "install.sh: the packages could not be installed (see above): is there a network, a proxy, space in / and ${TMPDIR:-/tmp}? Then run it again" >&2
    exit 1
}
ln -sf /opt/slz/.venv/bin/slz /usr/local/bin/slz
# The kernels are compiled now, by the service's own user, so that the first flight does not wait for them.
install -d -o slz -g slz -m 0700 /var/cache/slz /var/lib/slz
echo "compiling the kernels, some minutes"
cd /  # not the checkout: Python looks for modules where it stands
runuser -u slz -- env NUMBA_CACHE_DIR=/var/cache/slz /opt/slz/.venv/bin/python -c \
    'from companion.runtime.kernel_compilation import everything; everything()'

# Refused in a container, and on a computer whose kernel is another one's: no reason to stop here.
sysctl --quiet --load /etc/sysctl.d/60-slz.conf \
    || echo "install.sh: net.core.rmem_max could not be set: set it to 8388608 where the kernel is yours" >&2
{ udevadm control --reload && udevadm trigger --subsystem-match=tty; } \
    || echo "install.sh: no udev here: autopilots on USB get no names" >&2
systemctl daemon-reload
systemctl enable --quiet slz.service
if systemctl is-active --quiet slz.service; then
    echo "slz is running: restart it when the vehicle stands: systemctl restart slz"
else
    echo "edit /etc/slz/slz.env, see that 'slz-doctor' is content, then: systemctl start slz"
fi
