#!/bin/sh
# Builds the Dockerfile where no container engine runs, starts the server in the image and asks its health.
#
# The base image is made here, by debootstrap, under the name that the Dockerfile's FROM gives; buildah builds
# without namespaces (chroot isolation). pip is configured as on this machine, by files that are mounted during
# the build and stay out of the image. Needs root, debootstrap, buildah, curl. WORK keeps the base for next time.
set -eu

cd "$(dirname "$0")/.."
BASE=$(sed -n 's/^ARG BASE_IMAGE=//p' Dockerfile)
IMAGE=localhost/walk:check
PORT=${PORT:-8499}
MIRROR=${MIRROR:-http://deb.debian.org/debian}
WORK=${WORK:-$(mktemp -d /tmp/walk-image.XXXXXX)}
mkdir -p "$WORK"
export BUILDAH_ISOLATION=chroot
# Where overlay cannot be mounted: STORAGE_DRIVER=vfs, which takes some 15 GB.
STORE="--root $WORK/storage --runroot $WORK/run --storage-driver ${STORAGE_DRIVER:-overlay}"

build_base() {
    [ -d "$WORK/base/usr" ] || debootstrap --variant=minbase bookworm "$WORK/base" "$MIRROR" >"$WORK/debootstrap.log"
    # What makes Debian's slim image slim: no documentation, no translations, no package files.
    rm -rf "$WORK/base/usr/share/doc" "$WORK/base/usr/share/man" "$WORK/base/usr/share/locale" \
        "$WORK/base/var/cache/apt/archives" "$WORK/base/var/lib/apt/lists"
    mkdir -p "$WORK/base/var/cache/apt/archives/partial" "$WORK/base/var/lib/apt/lists/partial"
    container=$(buildah $STORE from scratch)
    buildah $STORE add --quiet "$container" "$WORK/base" / >/dev/null
    buildah $STORE config --cmd bash --env PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin "$container"
    buildah $STORE commit --quiet --rm "$container" "$BASE" >/dev/null
}

# This machine's settings of pip as one file, and the certificates and local folders that they name.
volumes() {
    python3 -m pip config list >"$WORK/pip.list"
    { echo '[global]'; sed -n "s/^\(global\|:env:\)\.\(cert\|index-url\|extra-index-url\|find-links\|timeout\)='\(.*\)'$/\2 = \3/p" \
        "$WORK/pip.list" | sort -u -t= -k1,1; } >"$WORK/pip.conf"
    echo "--volume $WORK/pip.conf:/etc/pip.conf:ro"
    cert=$(sed -n 's/^cert = //p' "$WORK/pip.conf")
    if [ -n "$cert" ]; then  # in a place of its own: Debian's certificates are installed during the build
        sed -i 's,^cert = .*,cert = /etc/pip.crt,' "$WORK/pip.conf"
        echo "--volume $cert:/etc/pip.crt:ro"
    fi
    sed -n 's/^\(extra-index-url\|index-url\|find-links\) = //p' "$WORK/pip.conf" | tr ' ' '\n' \
        | sed 's,^file://\(.*\)/[^/]*$,\1,' | sort -u \
        | while read -r path; do if [ -d "$path" ]; then echo "--volume $path:$path:ro"; fi; done
}

# A scripted run as a stranger posts it: its worker has to start, and to write to /data.
check_run() {
    body='{"name": "image check", "robot": "hrp2", "duration": 2}'
    location=$(curl -fsS -D - -o /dev/null -H 'Content-Type: application/json' -d "$body" "$URL/api/v1/runs" \
        | tr -d '\r' | sed -n 's/^location: //p')
    curl -fsSN "$URL$location/events" >"$WORK/events"  # ends with the run
    curl -fsS -o "$WORK/recording.npz" "$URL$location/recording.npz"
    echo "run: $(grep -o '"status":"[a-z]*"' "$WORK/events" | tail -1), recording of $(wc -c <"$WORK/recording.npz") bytes"
}

build_base
# shellcheck disable=SC2046  # the volumes are words
buildah $STORE bud --quiet --format docker --network host --pull-never $(volumes) --tag "$IMAGE" .
container=$(buildah $STORE from --pull-never "$IMAGE")
root=$(buildah $STORE mount "$container")
echo "image: $(du -sm "$root" | cut -f1) MB unpacked, $(tar -C "$root" -c . | gzip -1 | wc -c | awk '{print int($1 / 1e6)}') MB packed"

URL=http://127.0.0.1:$PORT
buildah $STORE run --env PORT="$PORT" --env HOST=127.0.0.1 "$container" -- sh -c 'echo $$; id -un; exec walk serve' \
    >"$WORK/server.log" 2>&1 &
trap 'kill "$(head -1 "$WORK/server.log")" 2>/dev/null || true; wait; buildah $STORE rm "$container" >/dev/null' EXIT
for _ in $(seq 180); do
    curl -fs "$URL/api/v1/health" >"$WORK/health.json" 2>/dev/null && break
    sleep 1
done
cat "$WORK/server.log"
echo "health: $(cat "$WORK/health.json")"
check_run
curl -fsS -o /dev/null "$URL/" && curl -fsS -o /dev/null "$URL/viewer/" && echo "page and scene: served"
