#!/usr/bin/env bash
# The same frames, bit for bit: every image of frame_hashes on every instruction set at hand and for 1, 2, 3 and 8 threads, and
# without skipping, against one thread of scalar code.
#
# Threads share out the same tasks whatever the instruction set, so every number of them is tried with the best one alone; a kernel that
# reaches into a neighbour's task shows as soon as tasks run beside each other, so each other one is tried with the most.
#
# usage: determinism.sh BUILD_DIR SOURCE_DIR           this build alone
#        determinism.sh BUILD_DIR SOURCE_DIR matrix    builds by gcc -O1, clang -O1 and clang -O3 without the optional libraries,
#                                                      on 3 threads, and one for aarch64 under qemu-user, in BUILD_DIR/determinism; the
#                                                      release build itself is gcc -O3 (scalar and sse4 kernels -O2), and is compared on every number of threads. The
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
reference=$results/reference.lines
names=() scenes_of=() unbuilt=() # by the comparison's number
skipped_one=

# start NUMBER COMMAND…: its lines into results/NUMBER.lines. As many run side by side as there are processors.
start()
{
    local number=$1
    shift
    while [ "$(jobs -rp | wc -l)" -ge "$(nproc)" ]; do wait -n; done
    { "$@" >"$results/$number.running" 2>"$results/$number.errors" && mv "$results/$number.running" "$results/$number.lines"; } &
}

# compare NAME COMMAND…: the command's lines against the reference's, once collect has both: it prints what differs in this order.
compare()
{
    names[compared]=$1
    scenes_of[compared]=$scenes
    shift
    start "$compared" "$@"
    compared=$((compared + 1))
}

collect()
{
    wait
    local number expected=$results/expected.txt
    if [ ! -f "$reference" ]; then
        echo "FAILED: frame_hashes itself: $(tail -n 1 "$results/reference.errors")"
        exit 1
    fi
    for ((number = 0; number < compared; number++)); do
        if [ -n "${unbuilt[number]:-}" ]; then
            echo "FAILED: ${unbuilt[number]}"
        elif ! grep -E "^(${scenes_of[number]// /|}) " "$reference" >"$expected"; then
            echo "FAILED: ${names[number]}: the reference has none of these scenes: ${scenes_of[number]}"
        elif [ ! -f "$results/$number.lines" ]; then
            echo "FAILED: ${names[number]}: $(tail -n 1 "$results/$number.errors")"
        elif ! cmp -s "$expected" "$results/$number.lines"; then
            echo "FAILED: ${names[number]} differs in (scene frame image):"
            diff "$expected" "$results/$number.lines" | sed -n 's/^> \(.*\) [0-9a-f]*$/    \1/p' | head -n 12
        else
            continue
        fi
        different=$((different + 1))
    done
}

# every_way NAME PROGRAM THREADS…: the best instruction set with each of the numbers of threads, the others with the last of them, then without
# skipping
every_way()
{
    local name=$1 program=$2 isa best threads
    shift 2
    best=$($program --isas | tail -n 1)
    for isa in $($program --isas); do
        for threads in "$@"; do
            [ "$isa" = "$best" ] || [ "$threads" = "${!#}" ] || continue
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
        unbuilt[compared]="the build in $folder: $(grep -m 1 -E 'error:|undefined reference|CMake Error' "$folder.log" || tail -n 1 "$folder.log")"
        compared=$((compared + 1))
        return 1
    fi
}

scenes=$("$build/frame_hashes" --scenes)
# shellcheck disable=SC2086
start reference "$build/frame_hashes" --isa scalar --threads 1 $scenes

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

    # An emulated processor is up to eighty times slower: two small scenes by each instruction set, one of them without skipping. By -O2, as -O3
    # takes twice as long to compile.
    if command -v aarch64-linux-gnu-gcc >/dev/null && command -v qemu-aarch64 >/dev/null; then
        folder=$work/aarch64
        if configure_and_build "$folder" -DCMAKE_SYSTEM_NAME=Linux -DCMAKE_SYSTEM_PROCESSOR=aarch64 \
            -DCMAKE_C_COMPILER=aarch64-linux-gnu-gcc -DEARTHSHINE_OPTIMIZE=-O2 "-DCMAKE_CROSSCOMPILING_EMULATOR=qemu-aarch64;-L;/usr/aarch64-linux-gnu"; then
            program="qemu-aarch64 -L /usr/aarch64-linux-gnu $folder/frame_hashes"
            # shellcheck disable=SC2086
            for isa in $($program --isas); do
                scenes="parts-small cornell-stack" threads=3
                [ "$isa" = scalar ] && threads=1
                compare "aarch64, $isa, $threads threads" $program --isa $isa --threads $threads $scenes
            done
            scenes="parts-small"
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
