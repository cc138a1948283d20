#!/usr/bin/env bash
# Installs the library into a fresh folder, moves it, and builds demos/embed.c against it as a stranger would: through the
# CMake package (from a project in C alone) and through pkg-config. Both programs must render a picture.
# usage: install.sh BUILD_DIR SOURCE_DIR
set -u
build=$1
source=$2
for tool in cmake pkg-config cc; do
    if ! command -v $tool >/dev/null; then
        echo "skipped: $tool is not installed"
        exit 77
    fi
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
unset DISPLAY
step()
{
    if ! "$@" >"$work/log" 2>&1; then
        cat "$work/log"
        echo "FAILED: $*"
        exit 1
    fi
}
picture()
{
    [ -s "$1" ] && [ "$(head -c 4 "$1" | tail -c 3)" = PNG ] && return
    echo "FAILED: $1 is no picture"
    exit 1
}

step cmake --install "$build" --prefix "$work/first"
mv "$work/first" "$work/installed" # nothing may remember where it was installed
if grep -rIl --include='*.cmake' --include='*.pc' -e "$build" -e "$source" -e "$work/first" "$work/installed"; then
    echo "FAILED: installed files name folders of the build"
    exit 1
fi
for header in platform raster sim gi; do
    [ -f "$work/installed/include/earthshine/$header.h" ] || { echo "FAILED: $header.h is not installed"; exit 1; }
done

mkdir "$work/package" "$work/package/build"
cp "$source/demos/embed.c" "$work/package/"
cat >"$work/package/CMakeLists.txt" <<'CMAKE'
cmake_minimum_required(VERSION 3.20)
project(embedding LANGUAGES C)
find_package(earthshine 0.1 REQUIRED)
add_executable(embed embed.c)
target_link_libraries(embed PRIVATE earthshine::earthshine)
CMAKE
step cmake -G Ninja -S "$work/package" -B "$work/package/build" -DCMAKE_PREFIX_PATH="$work/installed" -DCMAKE_BUILD_TYPE=Release
step cmake --build "$work/package/build"
step "$work/package/build/embed" "$work/package.png"
picture "$work/package.png"

PKG_CONFIG_PATH=$(dirname "$(find "$work/installed" -name earthshine.pc)")
export PKG_CONFIG_PATH
for flags in "" --static; do
    # shellcheck disable=SC2046,SC2086
    step cc -O2 -o "$work/embed" "$source/demos/embed.c" $(pkg-config $flags --cflags --libs earthshine) "-Wl,-rpath,$(pkg-config --variable=libdir earthshine)"
    step "$work/embed" "$work/pkg-config.png"
    picture "$work/pkg-config.png"
    rm "$work/pkg-config.png"
done
lines=$(wc -l <"$source/demos/embed.c")
[ "$lines" -le 80 ] || { echo "FAILED: embed.c has $lines lines, at most 80 are wanted"; exit 1; }
echo "embed.c built against the installed library through the CMake package and through pkg-config"
