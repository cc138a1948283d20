#!/usr/bin/env bash
# Each public header compiles alone, without a warning, as C11 and as C++17, with every compiler at hand.
# usage: headers.sh BUILD_DIR SOURCE_DIR
set -u
build=$1
source=$2
status=0

for floor in platform raster sim gi; do
    for compiler in gcc clang; do
        command -v $compiler >/dev/null || continue
        for language in "c -std=c11" "c++ -std=c++17"; do
            # shellcheck disable=SC2086
            if ! printf '#include <earthshine/%s.h>\n' $floor |
                $compiler -x $language -pedantic -Wall -Wextra -Werror -I"$build/include" -fsyntax-only -; then
                echo "FAILED: <earthshine/$floor.h> alone with $compiler -x $language"
                status=1
            fi
        done
    done
    cmp -s "$source/$floor/$floor.h" "$build/include/earthshine/$floor.h" ||
        { echo "FAILED: the build's <earthshine/$floor.h> is not $floor/$floor.h"; status=1; }
done
[ $status -eq 0 ] && echo "four public headers compile alone as C11 and C++17"
exit $status
