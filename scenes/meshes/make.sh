#!/bin/sh
# Makes every mesh of this folder again. Usage: scenes/meshes/make.sh [PATH OF lazytess]
set -eu
lazytess=$(command -v "${1:-lazytess}")
cd "$(dirname "$0")"
for mesh in *.obj; do
    "$lazytess" generate "${mesh%.obj}" -o "$mesh"
done
