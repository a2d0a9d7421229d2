#!/bin/sh
# Create the virtual environment $1 with the interpreter $2 or, without one, the first that is fit for it.
# Each is run and asked: a pyenv shim may stand on the path for a version that is not there, and Debian packages
# ensurepip apart from Python.
set -eu

venv=$1
for python in ${2:-python3.13 python3.12 python3.11 python3 python}; do
    if "$python" -c 'import ensurepip, sys, venv; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; then
        echo "virtual environment: $venv, $("$python" --version 2>&1)"
        exec "$python" -m venv --clear "$venv"
    fi
done

echo "no Python 3.11 or newer with its venv module${2:+ at $2}: install one" \
    "(\`apt install python3 python3-venv\`, \`dnf install python3\`, \`brew install python\`)" \
    "or name it: make PYTHON=/path/to/python" >&2
exit 3
