#!/usr/bin/env bash
# Build the container images from Debian's packages and wheels, without a registry of images. Run it as root from
# a checkout, with the packages debootstrap, buildah and python3-venv. For the other architecture also
# qemu-user-static and binfmt-support.
#
#   sudo deploy/image.sh [amd64|arm64] [FOLDER]     localhost/slz:ARCH and localhost/slz-blueos:ARCH
#
# FOLDER (out/image) keeps ARCH/root, a small Debian, and ARCH/wheels for the next time: delete it to begin anew.
# DEBIAN=http://... names another mirror, BUILDAH='--isolation chroot' options of buildah.
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
own=$(dpkg --print-architecture)
arch=${1:-$own}
case "$arch" in
    amd64) platforms=(manylinux_2_17_x86_64 manylinux_2_28_x86_64) ;;
    arm64) platforms=(manylinux_2_17_aarch64 manylinux_2_28_aarch64) ;;
    *) echo "image.sh: $arch is not known: write amd64 or arm64" >&2; exit 2 ;;
esac
[ "$(id -u)" = 0 ] || { echo "image.sh: run it as root: sudo deploy/image.sh" >&2; exit 2; }
work=$(mkdir -p "${2:-$here/out/image}/$arch" && cd "${2:-$here/out/image}/$arch" && pwd)
read -ra options <<< "${BUILDAH:-}"

if [ ! -e "$work/root/etc/debian_version" ]; then
    debootstrap --arch="$arch" --variant=minbase --include=python3,python3-venv,ca-certificates,procps \
        bookworm "$work/root" ${DEBIAN:+"$DEBIAN"}
    chroot "$work/root" apt-get clean
    rm -rf "$work"/root/var/lib/apt/lists/* "$work"/root/usr/share/{doc,man,locale,info}/*
fi

# The checkout's files in a folder of their own: no build folder of an earlier version gets into the wheel.
rm -rf "$work/context"
mkdir -p "$work/context" "$work/wheels"
for part in companion slz params sitl deploy pyproject.toml constraints.txt README.md LICENSE NOTICE; do
    cp -r "$here/$part" "$work/context/"
done
find "$work/context" -name __pycache__ -prune -exec rm -rf {} +
if [ ! -e "$work/tools" ]; then
    python3 -m venv "$work/tools"
fi
if [ ! -e "$work/wheels/complete" ]; then
    "$work/tools/bin/pip" wheel --quiet --no-deps --wheel-dir "$work/own" "$work/context"
    "$work/tools/bin/pip" download --quiet --dest "$work/wheels" --only-binary :all: --python-version 3.11 \
        --implementation cp "${platforms[@]/#/--platform=}" --constraint "$here/constraints.txt" \
        "setuptools>=77" "$(ls "$work"/own/slz-*.whl)[page,record]"
    rm -rf "$work/context/build" "$work"/context/*.egg-info "$work"/wheels/slz-*.whl
    touch "$work/wheels/complete"
fi

base=localhost/slz-debian:$arch
container=$(buildah from --arch "$arch" scratch)
buildah add --quiet "$container" "$work/root" /
buildah commit --quiet --rm "$container" "$base"
kernels=yes
[ "$arch" = "$own" ] || kernels=no  # under an emulator, and for a processor that nobody has
buildah build "${options[@]}" --arch "$arch" --pull-never --volume "$work/wheels:/wheels:ro" \
    --build-arg BASE="$base" --build-arg KERNELS="$kernels" \
    --build-arg PIP_OPTIONS="--no-index --find-links /wheels" \
    --file "$here/deploy/Containerfile" --tag "localhost/slz:$arch" "$work/context"
buildah build "${options[@]}" --arch "$arch" --pull-never --build-arg BASE="localhost/slz:$arch" \
    --file "$here/deploy/blueos/Containerfile" --tag "localhost/slz-blueos:$arch" "$here/deploy/blueos"
buildah images
