#!/bin/sh
# See to the clients of the tests beside Python: a Chromium on the PATH, OpenEXR's own `exrheader`, and the packages of
# tests/publishing/node. Installs what is missing where apt-get is there and may run; where it cannot, it says so, and
# the tests that need it are skipped.
set -eu

path_of_chromium() {
    for name in chromium chromium-browser google-chrome; do
        command -v "$name" && return
    done
    return 1
}

missing=
path_of_chromium >/dev/null || missing="chromium"
command -v exrheader >/dev/null || missing="$missing openexr"

if [ -n "$missing" ] && command -v apt-get >/dev/null; then
    as_root=
    if [ "$(id -u)" != 0 ]; then as_root="sudo -n"; fi
    if $as_root true 2>/dev/null; then
        echo "browser: installing $missing"
        $as_root env DEBIAN_FRONTEND=noninteractive apt-get update -qq >/dev/null 2>&1 || true
        for package in $missing; do
            $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$package" >/dev/null || true
        done
    fi
fi

if found=$(path_of_chromium); then
    echo "browser: $found"
else
    echo "browser: no Chromium, and no apt-get that may install one: tests of pages are skipped"
fi
command -v exrheader >/dev/null || echo "exrheader: not there: tests that read files with it are skipped"

node=$(dirname "$0")/../tests/publishing/node
if command -v npm >/dev/null; then
    npm ci --silent --no-audit --no-fund --prefix "$node"
    echo "node: packages of tests/publishing/node"
else
    echo "node: no npm: tests that read files with JavaScript libraries are skipped"
fi
