#!/bin/sh
# Does the cache's protocol hold under every interleaving? (a few minutes)
set -eu
cd "$(dirname "$0")/.."
export RUSTFLAGS="--cfg loom" CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-target}/loom"
exec cargo test --release --test loom "$@"
