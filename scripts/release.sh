#!/usr/bin/env bash
# A tarball that runs without an installation: the static program with completions and manual
# pages, made from the checkout's revision and checked in an empty root.
#
#     scripts/release.sh [FOLDER]      # default: target/release-tarball
#
# For x86_64 with musl where `rustup target add x86_64-unknown-linux-musl` was done, else with glibc
# linked in. Needs Rust, GNU tar and gzip; the empty root needs `unshare` and the permission to make a
# user namespace, else it is left out with a message.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

out=$(realpath -m "${1:-target/release-tarball}")
if [ "$(rustc -vV | sed -n 's/^host: //p')" != x86_64-unknown-linux-gnu ]; then
    echo "release.sh makes the x86_64 Linux tarball, on such a machine" >&2
    exit 1
fi
if [ -d "$(rustc --print sysroot)/lib/rustlib/x86_64-unknown-linux-musl" ]; then
    target=x86_64-unknown-linux-musl
else
    target=x86_64-unknown-linux-gnu
fi

# Paths of the machine that builds do not belong into the program.
export RUSTFLAGS="-C target-feature=+crt-static -C strip=symbols \
--remap-path-prefix=$PWD=/fluxform --remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}=/cargo"
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}/static
started=$(date +%s)
cargo build --release --locked --target "$target"
built=$(($(date +%s) - started))
program=$CARGO_TARGET_DIR/$target/release/fluxform

version=$(cargo pkgid --locked | sed 's/.*[#@]//')
name=fluxform-$version-x86_64-linux
stage=$(mktemp -d)
trap 'rm -rf "$stage"' EXIT
mkdir -p "$stage/$name/completions" "$stage/$name/man"
cp "$program" README.md CHANGELOG.md LICENSE-MIT LICENSE-APACHE "$stage/$name/"
cp -r designs shapes "$stage/$name/"
mkdir "$stage/$name/results" && cp results/README.md results/half_sphere.svg results/face.png "$stage/$name/results/"
"$program" man --out "$stage/$name/man"
for shell in bash zsh fish; do
    "$program" completions "$shell" >"$stage/$name/completions/fluxform.$shell"
done

mkdir -p "$out"
tarball=$out/$name.tar.gz
tar --sort=name --owner=0 --group=0 --numeric-owner --mode=u+rwX,go+rX,go-w \
    --mtime="@$(git log -1 --format=%ct)" -C "$stage" -cf - "$name" | gzip -n9 >"$tarball"
(cd "$out" && sha256sum "$name.tar.gz" >"$name.tar.gz.sha256")

# Nothing but the tarball's content stands in this root: no libraries, no shell, no /proc.
root=$stage/root
mkdir -p "$root/tmp"
tar -xzf "$tarball" -C "$root" --strip-components=1
in_root() {
    unshare --user --map-root-user chroot "$root" "$@"
}
if in_root /fluxform --version >/dev/null 2>&1; then
    in_root /fluxform --version
    in_root /fluxform calibrate designs/seed.toml shapes/flat.toml shapes/wedge.toml --out tmp --quiet
    in_root /fluxform verify tmp/seed/wedge --quiet
    in_root /fluxform calibrate designs/seed.toml shapes/half_sphere.stl --unit mm \
        --translate 0,0,30 --out tmp/stl --quiet
    echo "checked in an empty root: calibrate of two shapes and a surface, verify"
else
    echo "not checked in an empty root: no user namespaces here" >&2
fi
echo "$tarball: $(stat -c %s "$tarball") bytes; the program $(stat -c %s "$program") bytes ($target), built in $built s"
