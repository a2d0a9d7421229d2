#!/bin/sh
# See to what the page's tests need beside Python: a Chromium on the PATH, and the packages of tests/publishing/node.
# Installs Chromium where apt-get is there and may run; where it cannot, it says so, and those tests are skipped.
set -eu

found=
for name in chromium chromium-browser google-chrome; do
    found=${found:-$(command -v "$name" || true)}
done

if [ -z "$found" ] && command -v apt-get >/dev/null; then
    as_root=
    if [ "$(id -u)" != 0 ]; then as_root="sudo -n"; fi
    if $as_root true 2>/dev/null; then
        echo "browser: installing chromium"
        $as_root env DEBIAN_FRONTEND=noninteractive apt-get update -qq >/dev/null 2>&1 || true
        $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends chromium >/dev/null || true
        found=$(command -v chromium || true)
    fi
fi

if [ -n "$found" ]; then
    echo "browser: $found"
else
    echo "browser: no Chromium, and no apt-get that may install one: tests of the page are skipped"
fi

node=$(dirname "$0")/../tests/publishing/node
if [ ! -f "$node/package.json" ]; then
    exit 0
elif command -v npm >/dev/null; then
    npm ci --silent --no-audit --no-fund --prefix "$node"
    echo "node: packages of tests/publishing/node"
else
    echo "node: no npm: tests that read files with JavaScript libraries are skipped"
fi
