#!/usr/bin/env bash
# The same frames, bit for bit: every image of frame_hashes for 1, 2, 3 and 8 threads on every instruction set at hand, and
# without skipping, against one thread of scalar code.
#
# usage: determinism.sh BUILD_DIR SOURCE_DIR           this build alone
#        determinism.sh BUILD_DIR SOURCE_DIR matrix    builds by gcc -O1, clang -O1 and clang -O3 without the optional libraries,
#                                                      on 3 threads, and one for aarch64 under qemu-user, in BUILD_DIR/determinism; the
#                                                      release build itself is gcc -O3, and is compared on every number of threads. The
#                                                      builds have the instruction sets that this processor runs, those by -O1 scalar code
#                                                      and the best of them
# Ends with "N compared, N different".
set -u
build=$1
source=$2
matrix=${3:-}
work=$build/determinism
results=$work/results
rm -rf "$results"
mkdir -p "$results"
compared=0
different=0
reference=$work/reference.txt
skipped_one=

# compare NAME COMMAND…: the command's lines against the reference's. As many run side by side as there are processors; what each found
# lies in results/NUMBER, empty when nothing differs, and collect prints it in their order.
compare()
{
    local name=$1 number=$compared
    shift
    compared=$((compared + 1))
    while [ "$(jobs -rp | wc -l)" -ge "$(nproc)" ]; do wait -n; done
    {
        local lines=$results/$number.lines
        if ! "$@" >"$lines" 2>"$results/$number.errors"; then
            echo "FAILED: $name: $(tail -n 1 "$results/$number.errors")"
        elif ! grep -E "^(${scenes// /|}) " "$reference" | cmp -s - "$lines"; then
            echo "FAILED: $name differs in (scene frame image):"
            grep -E "^(${scenes// /|}) " "$reference" | diff - "$lines" | sed -n 's/^> \(.*\) [0-9a-f]*$/    \1/p' | head -n 12
        fi
    } >"$results/$number.running" && mv "$results/$number.running" "$results/$number" &
}

collect()
{
    wait
    local number
    for ((number = 0; number < compared; number++)); do
        [ -f "$results/$number" ] || echo "FAILED: comparison $number did not end" >"$results/$number"
        [ -s "$results/$number" ] || continue
        different=$((different + 1))
        cat "$results/$number"
    done
}

# every_way NAME PROGRAM THREADS…: all instruction sets with each of the numbers of threads, then without skipping
every_way()
{
    local name=$1 program=$2 isa threads
    shift 2
    for isa in $($program --isas); do
        for threads in "$@"; do
            # shellcheck disable=SC2086
            compare "$name, $isa, $threads threads" $program --isa $isa --threads $threads $scenes
        done
    done
    # shellcheck disable=SC2086
    compare "$name, --no-skip" $program --no-skip $scenes
}

# shellcheck disable=SC2086
configure_and_build()
{
    local folder=$1
    shift
    if ! cmake -S "$source" -B "$folder" -G Ninja -DCMAKE_BUILD_TYPE=Release -DEARTHSHINE_TESTS=ON -DEARTHSHINE_DEMOS=OFF \
        -DEARTHSHINE_WITH_OPENEXR=OFF -DEARTHSHINE_WITH_PNG=OFF -DEARTHSHINE_WITH_GLFW=OFF -DEARTHSHINE_WITH_TINYGLTF=OFF \
        "$@" >"$folder.log" 2>&1 || ! cmake --build "$folder" --target frame_hashes >>"$folder.log" 2>&1; then
        echo "FAILED: the build in $folder: $(grep -m 1 -E 'error:|undefined reference|CMake Error' "$folder.log" || tail -n 1 "$folder.log")" >"$results/$compared"
        compared=$((compared + 1))
        return 1
    fi
}

scenes=$("$build/frame_hashes" --scenes)
# shellcheck disable=SC2086
if ! "$build/frame_hashes" --isa scalar --threads 1 $scenes >"$reference"; then
    echo "FAILED: frame_hashes itself"
    exit 1
fi

if [ -z "$matrix" ]; then
    every_way "this build" "$build/frame_hashes" 1 2 3 8
else
    for compiler in gcc clang; do
        if ! command -v $compiler >/dev/null; then
            echo "skipped: $compiler is not installed"
            skipped_one=1
            continue
        fi
        for level in -O1 -O3; do
            [ "$compiler $level" = "gcc -O3" ] && continue
            folder=$work/$compiler$level
            isas=$("$build/frame_hashes" --isas)
            [ $level = -O1 ] && isas="scalar $(tail -n 1 <<<"$isas")"
            if configure_and_build "$folder" -DCMAKE_C_COMPILER=$compiler -DEARTHSHINE_OPTIMIZE=$level "-DEARTHSHINE_ISAS=$(tr -s ' \n' ';' <<<"$isas" | sed 's/;$//')"; then
                every_way "$compiler $level" "$folder/frame_hashes" 3
            fi
        done
    done

    # An emulated processor is some thirty times slower: three scenes at most, each way once.
    if command -v aarch64-linux-gnu-gcc >/dev/null && command -v qemu-aarch64 >/dev/null; then
        folder=$work/aarch64
        if configure_and_build "$folder" -DCMAKE_SYSTEM_NAME=Linux -DCMAKE_SYSTEM_PROCESSOR=aarch64 \
            -DCMAKE_C_COMPILER=aarch64-linux-gnu-gcc "-DCMAKE_CROSSCOMPILING_EMULATOR=qemu-aarch64;-L;/usr/aarch64-linux-gnu"; then
            program="qemu-aarch64 -L /usr/aarch64-linux-gnu $folder/frame_hashes"
            # shellcheck disable=SC2086
            for isa in $($program --isas); do
                scenes="cornell parts cornell-stack" threads=3
                [ "$isa" = scalar ] && scenes="parts cornell-stack" threads=1
                compare "aarch64, $isa, $threads threads" $program --isa $isa --threads $threads $scenes
            done
            scenes="cornell cornell-stack"
            # shellcheck disable=SC2086
            compare "aarch64, --no-skip" $program --no-skip $scenes
        fi
    else
        echo "skipped: aarch64 needs aarch64-linux-gnu-gcc and qemu-aarch64"
        skipped_one=1
    fi
fi

collect
[ -n "$skipped_one" ] && echo "some of the matrix was skipped"
echo "$compared compared, $different different"
[ $different -eq 0 ]
