#!/usr/bin/env bash
# Every image of every frame of frame_hashes against tests/goldens.txt: a change names the images it reached, so the first
# of them in the order of the frame plan is the pass that made it.
#
# usage: goldens.sh BUILD_DIR SOURCE_DIR            compares
#        goldens.sh BUILD_DIR SOURCE_DIR --update   writes tests/goldens.txt anew (tests/run --update-goldens does it)
# After an intended change of the picture: update, look at what changed with `git diff tests/goldens.txt`, and commit it
# together with the change, saying why the picture is better.
set -u
build=$1
source=$2
goldens=$source/tests/goldens.txt
lines=$build/goldens.txt

if ! "$build/frame_hashes" >"$lines"; then
    echo "FAILED: frame_hashes does not run"
    exit 1
fi
if [ "${3:-}" = --update ]; then
    cp "$lines" "$goldens"
    echo "wrote $(wc -l <"$goldens") hashes to $goldens"
    exit 0
fi
if [ ! -f "$goldens" ]; then
    echo "FAILED: tests/goldens.txt is missing; tests/run --update-goldens writes it"
    exit 1
fi
if cmp -s "$goldens" "$lines"; then
    echo "$(wc -l <"$goldens") images are as they were"
    exit 0
fi

# both files are SCENE FRAME IMAGE HASH
awk '
    { key = $1 " " $2 " " $3 }
    NR == FNR { golden[key] = $4; next }
    { seen[key] = 1
      if (!(key in golden)) added[++additions] = key
      else if (golden[key] != $4) { changed[$1]++; if (!(($1 " " $3) in named)) { named[$1 " " $3] = 1; order[++count] = $1 " " $3 " first in frame " $2 } } }
    END {
        for (i = 1; i <= count; i++) print "CHANGED: " order[i]
        for (i = 1; i <= additions; i++) print "NOT IN THE GOLDENS: " added[i]
        for (key in golden) if (!(key in seen)) print "NO LONGER MADE: " key
        for (scene in changed) print scene ": " changed[scene] " images changed"
    }' "$goldens" "$lines"
echo "to see them: mkdir now && $build/frame_hashes --write now"
exit 1
