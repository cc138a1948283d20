#!/usr/bin/env bash
# The command line: every command, its results, its exit codes, and one line of refusal for everything that cannot be done.
# usage: cli.sh BUILD_DIR SOURCE_DIR
set -u
build=$1
program=$build/earthshine
if [ ! -x "$program" ]; then
    echo "skipped: the program is not built (EARTHSHINE_DEMOS)"
    exit 77
fi
work=$(mktemp -d)
trap 'chmod -R u+w "$work"; rm -rf "$work"' EXIT
cd "$work" || exit 1
unset DISPLAY WAYLAND_DISPLAY
checks=0
failures=0
small=(--size 64x48 --threads 2 --set vpl.count=64 --set ism.points=1024 --set ism.pool=65536 --set ism.size=32)

fail()
{
    failures=$((failures + 1))
    echo "FAILED: $1"
    sed 's/^/    stdout: /' out | head -n 5
    sed 's/^/    stderr: /' err | head -n 5
}

# expect CODE ARGUMENTS…: runs the program, leaves its streams in out and err
expect()
{
    local code=$1 got
    shift
    checks=$((checks + 1))
    timeout 120 "$program" "$@" >out 2>err </dev/null
    got=$?
    [ $got -eq "$code" ] || fail "exit $got instead of $code: earthshine $*"
}

# refused TEXT ARGUMENTS…: exit 2, nothing on stdout, and one line that contains TEXT besides warnings
refused()
{
    local text=$1
    shift
    expect 2 "$@"
    [ ! -s out ] || fail "a refusal writes to stdout: earthshine $*"
    [ "$(grep -vc '^earthshine: warning: ' err)" = 1 ] || fail "a refusal is not one line: earthshine $*"
    grep -qF -- "$text" err || fail "the refusal does not say '$text': earthshine $*"
}

says()
{
    grep -qE -- "$1" "${2:-out}" || fail "no line matches '$1'"
}

# ---- listings --------------------------------------------------------------------------------------------------------
expect 0 help
says '^usage:'
expect 0 render --help
says '^usage:'
expect 0 --version
says '^earthshine [0-9]+\.[0-9]+\.[0-9]+ \('
expect 0 scenes
for scene in cornell room hall maze; do says "^$scene +[^ ]"; done
expect 0 scenes --settings
for scene in cornell room hall maze; do says "^$scene +[^ ]"; done
expect 0 settings
says '^width +1024 '
says '^world\.triangles '
expect 0 images
for image in display direct indirect depth normal motion albedo; do says "^$image +[^ ]"; done
expect 2
refused 'did you mean render?' rendr
refused '`earthshine help` lists all' bogus
refused 'takes no arguments but --settings, there is --setings' scenes --setings
refused 'unknown command' frobnicate
refused 'takes no arguments' scenes all

# ---- render ----------------------------------------------------------------------------------------------------------
expect 0 render cornell "${small[@]}" --hash
says '^frame 0 display [0-9a-f]{16}$'
[ "$(wc -l <out)" = 1 ] || fail 'one frame, one hash'
cp out first
expect 0 render cornell "${small[@]}" --hash --no-skip --threads 1 --isa scalar
cmp -s out first || fail 'the hash depends on threads, instruction set or skipping'
expect 0 render cornell "${small[@]}" --frames 1:3 --fps 10 --hash --image depth --image direct
says '^frame 1 depth '
says '^frame 2 direct '
[ "$(wc -l <out)" = 4 ] || fail 'two frames of two images, four hashes'
cp out later
expect 0 render cornell "${small[@]}" --frames 2:3 --fps 10 --hash --image depth
grep -qxF "$(cat out)" later || fail 'a frame depends on whether the one before was rendered'
expect 0 render cornell "${small[@]}" --out 'a%%b-%03d.png' --frames 0:2
[ -s 'a%b-000.png' ] && [ -s 'a%b-001.png' ] || fail 'frames are not where the pattern says'
expect 0 render cornell "${small[@]}" --out=one.exr --image=indirect --gi ism --set exposure=1 --stats stats.json
[ -s one.exr ] || fail 'no EXR file'
expect 0 render cornell "${small[@]}" --out one.hdr --gi none
[ -s one.hdr ] || fail 'no HDR file'
[ "$(find . -name '*.tmp*' -o -name '.earthshine*' | wc -l)" = 0 ] || fail 'temporary files are left behind'
if command -v python3 >/dev/null; then
    checks=$((checks + 1))
    python3 - <<'PYTHON' >out 2>err || fail 'the statistics are not as described'
import json
stats = json.load(open('stats.json'))
assert set(stats) >= {'machine', 'frames', 'peak_bytes'}, stats.keys()
assert set(stats['machine']) >= {'processor', 'isa', 'threads', 'compiler', 'commit', 'flags'}
assert stats['machine']['threads'] == 2 and stats['peak_bytes'] > 0
frame, = stats['frames']
assert frame['frame'] == 0 and frame['ms'] > 0
for a_pass in frame['passes']:
    assert set(a_pass) >= {'name', 'ms', 'skipped', 'count'}
    assert a_pass['skipped'] is None or a_pass['skipped'] != ''
assert any(p['skipped'] is None for p in frame['passes'])
PYTHON
fi

# ---- recordings --------------------------------------------------------------------------------------------------------
expect 0 render cornell-stack "${small[@]}" --set exposure=1 --frames 0:6 --hash --record stack.rec
cp out recorded
expect 0 render --replay stack.rec --size 64x48 --hash --threads 1 --isa scalar
cmp -s out recorded || fail 'a replay shows something else than was recorded'
expect 0 render --replay stack.rec
says '6 steps' err
expect 0 render --replay stack.rec --size 64x48 --frames 4:5 --hash
says '^frame 4 display '
refused '6 frames' render --replay stack.rec --frames 0:7 --hash
refused 'is a recording of cornell-stack' render cornell --replay stack.rec
refused 'exclude each other' render --replay stack.rec --record other.rec
refused 'last as long as the recorded' render --replay stack.rec --fps 10 --hash
refused 'last as long as the recorded' play --fps=10 --replay stack.rec
refused 'nowhere' render cornell --record nowhere/at.rec
refused 'missing.rec' render --replay missing.rec
head -c 2000 stack.rec >damaged.rec
refused 'damaged' render --replay damaged.rec
refused 'option of render and play' reference cornell --out truth.exr --record other.rec

expect 0 render cornell --size 8x48 --gi none --out cube.hdr
expect 0 render cornell --size 16x8 --gi none --image depth --out depth.exr
expect 0 render stress "${small[@]}" --hash --image background --environment one.hdr
cp out first
expect 0 render stress "${small[@]}" --hash --image background --environment one.hdr --environment-rotation 2 --environment-intensity 3
! cmp -s out first || fail 'the environment is neither turned nor brighter'
expect 0 reference cornell --size 64x48 --spp 1 --hash --environment one.hdr
refused 'missing.exr' render cornell --hash --environment missing.exr
refused 'lat-long picture is expected' render cornell --hash --environment cube.hdr
refused 'must have red, green and blue' render cornell --hash --environment depth.exr
cat >edits.gltf <<'JSON'
{"asset": {"version": "2.0"}, "scenes": [{"extras": {"earthshine": {"edits": {"constraints": [{"reflecting": {"index": 0, "triangle": 0}, "reflected": {"point": [0, 1, 0]}}]}}}}]}
JSON
expect 0 render cornell "${small[@]}" --hash --edits edits.gltf
expect 0 reference cornell --size 8x8 --spp 1 --hash --edits edits.gltf
refused 'missing.gltf' render cornell --hash --edits missing.gltf
echo '{}' >empty.gltf
refused 'has no edits' render cornell --hash --edits empty.gltf
sed 's/"index": 0/"node": "nobody"/' edits.gltf >nobody.gltf
refused "constraints[0].reflecting: there is no node 'nobody'" render cornell --hash --edits nobody.gltf
refused '--environment-rotation x' render cornell --hash --environment-rotation x
refused '--environment-intensity -1' render cornell --hash --environment-intensity -1
refused 'scene' render
refused 'nothing would come of it' render cornell
refused "nearest is 'cornell'" render cornel --hash
refused 'unknown option --bogus; `earthshine help` lists all' render cornell --bogus
refused 'did you mean vpl.count?' render cornell --hash --set vpls=1
refused 'there is camera 0 alone' render cornell --hash --set world.camera=1
refused 'did you mean --size' render cornell --siez 64x48 --hash
refused 'a value must follow' render cornell --hash --size
refused 'two' render cornell room --hash
for size in 0x0 0x10 20000x20000 8193x10 64 x 64x 64x48x2 -5x10 1e3x10 99999999999x1; do refused "--size $size" render cornell --hash --size $size; done
refused 'width' render cornell --hash --set width=20000
refused 'holds no frame' render cornell --hash --frames 3:3
refused 'A:B is expected' render cornell --hash --frames 3
refused 'A:B is expected' render cornell --hash --frames 0:99999999
refused '--fps 0' render cornell --hash --fps 0
refused '--fps nan' render cornell --hash --fps nan
refused '--threads 0' render cornell --hash --threads 0
refused '--threads 65' render cornell --hash --threads 65
refused 'scalar, sse4, avx2, avx512 or neon' render cornell --hash --isa mmx
refused 'none, ism, classic, vpl-traced, vpl-sampled, micro or second-order' render cornell --hash --gi photons
refused 'key=value' render cornell --hash --set exposure
refused 'did you mean exposure' render cornell --hash --set exposuer=1
refused 'did you mean world.triangles' render cornell --hash --set triangels=1
refused 'no such setting' render cornell --hash --set zzzzzzzzzz=1
refused 'exposure' render cornell --hash --set exposure=bright
refused 'exposure' render cornell --hash --set exposure=1e30
refused 'exposure' render cornell --hash --set exposure=nan
refused 'vpl.count' render cornell --hash --set vpl.count=-1
refused 'did you mean indirect' render cornell --hash --image indirekt

# ---- output that cannot be -------------------------------------------------------------------------------------------
mkdir folder locked
refused '.exr, .png or .hdr' render cornell --out picture.jpg
refused '.exr, .png or .hdr' render cornell --out picture
refused 'put %04d' render cornell --out one.png --frames 0:2
refused 'may stand for' render cornell --out '%s.png'
refused 'may stand for' render cornell --out '%n%d.png'
refused 'may stand for' render cornell --out '%*d.png'
refused 'may stand for' render cornell --out '%99d.png'
refused 'may stand for' render cornell --out 'x.png%'.png
refused 'one frame number' render cornell --out '%d-%d.png'
refused 'no directory' render cornell --out nowhere/at/all.png
refused 'not a directory' render cornell --out one.exr/x.png
refused 'cannot be written' render cornell --out /proc/x.png
mkdir folder.png
refused 'not a file' render cornell --out folder.png
refused 'no directory' render cornell --hash --stats nowhere/stats.json
refused 'not a file' render cornell --hash --stats folder
refused 'takes one image' render cornell --out x.png --image depth --image direct
if [ "$(id -u)" != 0 ]; then
    chmod a-w locked
    refused 'cannot be written' render cornell --out locked/x.png
fi
[ "$(find folder locked folder.png -type f | wc -l)" = 0 ] || fail 'a refusal leaves files behind'

# ---- input that cannot be --------------------------------------------------------------------------------------------
: >empty.glb
: >empty.gltf
printf 'glTF\002\000\000\000' >short.glb
printf 'this is a letter, not a model\n' >letter.glb
printf '{"asset":{"version":"2.0"' >cut.gltf
printf '{"asset":{"version":"1.0"}}' >old.gltf
printf '{"asset":{"version":"2.0"},"extensionsRequired":["ACME_teapots"],"extensionsUsed":["ACME_teapots"]}' >acme.gltf
head -c 4096 /dev/urandom >noise.glb
refused 'missing.glb' render missing.glb --hash
refused 'folder' render folder --hash
for file in empty.glb empty.gltf short.glb letter.glb cut.gltf old.gltf noise.glb one.exr; do refused "$file" render $file --hash; done
grep -q EARTHSHINE_WITH_TINYGLTF:BOOL=OFF "$build/CMakeCache.txt" || refused 'ACME_teapots' render acme.gltf --hash

# ---- reference -------------------------------------------------------------------------------------------------------
ray=(--size 12x9 --threads 2)
expect 0 reference cornell "${ray[@]}" --spp 3 --out half.exr --hash
expect 0 reference cornell "${ray[@]}" --spp 5 --hash
cp out whole
expect 0 reference cornell "${ray[@]}" --spp 5 --resume half.exr --hash --stats reference.json
cmp -s out whole || fail 'samples of two calls are not those of one'
[ -s reference.json ] || fail 'no statistics of a reference'
refused 'scene' reference
refused 'nothing would come of it' reference cornell
refused 'option of render' reference cornell --hash --gi ism
refused 'option of reference' render cornell --hash --spp 4
refused 'reference.samples' reference cornell --hash --spp many
refused 'reference.bounces' reference cornell --hash --bounces 65
refused 'reference.error' reference cornell --hash --error nan
refused 'setting of render' reference cornell --hash --set exposure=1
refused 'bounce-1' reference cornell --hash --image bounce-2
refused 'direct and indirect are known' reference cornell --hash --bounces 0 --image bounce-1

# interrupted: what there is is kept; frames that are missing are a failure
checks=$((checks + 2))
# sends the signal once it would be caught, however long a busy machine takes to get there
interrupted() {
    local signal=$1 caught pid
    shift
    "$program" "$@" 2>err &
    pid=$!
    for _ in $(seq 600); do
        caught=$(sed -n 's/^SigCgt:[[:space:]]*//p' "/proc/$pid/status" 2>/dev/null) || break
        (( (0x${caught:-0} >> ($(kill -l "$signal") - 1)) & 1 )) && break
        sleep 0.1
    done
    sleep 1
    kill -s "$signal" "$pid" 2>/dev/null
    wait "$pid"
}
interrupted TERM reference cornell --size 16x12 --seconds 1000 --out stopped.exr || fail "exit $? of an interrupted reference"
grep -q 'interrupted; --resume stopped.exr goes on from here' err || fail 'an interrupted reference does not say how to go on'
expect 0 reference cornell --size 16x12 --spp 1 --resume stopped.exr --hash
interrupted INT reference cornell --size 16x12 --seconds 1000 --frames 0:2 --out 'stopped%d.exr'
[ $? -eq 130 ] || fail 'frames that an interrupt left out are not reported'
refused 'one frame is expected' reference cornell --hash --frames 0:2 --resume half.exr
refused 'missing.exr' reference cornell "${ray[@]}" --hash --resume missing.exr
refused 'another world' reference cornell --size 9x12 --hash --resume half.exr
refused 'another world' reference cornell "${ray[@]}" --set reference.seed=1 --hash --resume half.exr
refused 'it has no sums' reference cornell "${ray[@]}" --hash --resume one.exr
head -c 1000 half.exr >broken.exr
refused 'broken.exr' reference cornell "${ray[@]}" --hash --resume broken.exr
refused 'no directory' reference cornell --spp 1 --out nowhere/a.exr
[ ! -e a.exr ] || fail 'a refusal leaves files behind'

# ---- anything at all -------------------------------------------------------------------------------------------------
# Arguments by chance, the same in every run, with one among them that no command takes.
pieces=('' ' ' % %s%n.png -- - = --= -- 0 -1 1e999 nan 0x10 99999999999999999999 $'two\nlines' $'\e[2J\a' $'\xff\xfe' ../../.. cornell /dev/null "$(printf 'long%.0s' {1..600})"
    --size --size=0x7 --frames --frames=: --out --out=%d.exr --set --set==1 --set=vpl.count= --set=reference.seed=0x1 --image --image=depth --hash --stats --resume --spp=-0
    --seconds=inf --error --bounces=1e1 --fps= --threads=65536 --isa=avx --gi --no-skip --no-skip=yes)
RANDOM=7
for command in render reference; do
    for turn in {1..25}; do
        arguments=()
        for ((i = RANDOM % 6; i >= 0; i--)); do arguments+=("${pieces[RANDOM % ${#pieces[@]}]}"); done
        place=$((RANDOM % (${#arguments[@]} + 1)))
        refused '' "$command" "${arguments[@]:0:place}" --frobnicate "${arguments[@]:place}"
    done
done

# ---- compare ---------------------------------------------------------------------------------------------------------
expect 0 render cornell "${small[@]}" --out a.exr --image direct
expect 0 render cornell "${small[@]}" --out b.exr --image direct --frames 1:2 --fps 2
metrics='rmse relrmse relmse rell1 flip hdr_flip max'
expect 0 compare a.exr a.exr
for name in $metrics; do says "^$name 0$"; done
expect 0 compare a.exr b.exr --diff diff.png
[ "$(cut -d' ' -f1 out | tr '\n' ' ')" = "$metrics " ] || fail 'a name and a value a line, in their order'
for name in $metrics; do says "^$name [0-9.e-]+$"; done
[ -s diff.png ] || fail 'no picture of the difference'
cp out all_threads
expect 0 compare a.exr b.exr --threads 1
cmp -s out all_threads || fail 'an error depends on the number of threads'
for map in absolute relative signed flip hdr-flip; do
    expect 0 compare a.exr b.exr --diff "map-$map.png" --map $map --scale 0.5
    says '0\.5' err
    [ -s "map-$map.png" ] || fail "no map $map"
done
[ "$(cat map-*.png | cksum)" != "$(cat map-absolute.png map-absolute.png map-absolute.png map-absolute.png map-absolute.png | cksum)" ] || fail 'all maps are the same'
for name in $metrics; do
    expect 1 compare a.exr b.exr --max-$name 1e-9
    says "$name is .* limit" err
    says '^rmse '
    expect 0 compare a.exr b.exr --max-$name 1e9
done

# as displayed: a PNG has no radiance
expect 0 render cornell "${small[@]}" --out a.png
expect 0 render cornell "${small[@]}" --out b.png --frames 1:2 --fps 2
expect 0 compare a.png b.png
says '^hdr_flip -?nan$'
says '^flip 0\.[0-9]+$'
expect 0 compare a.exr b.exr --display-referred
says '^hdr_flip -?nan$'
refused 'no such number' compare a.png b.png --max-hdr_flip 1
refused 'display-referred' compare a.png b.png --diff x.png --map hdr-flip
expect 0 render cornell "${small[@]}" --out depth.exr --image depth
expect 0 compare depth.exr depth.exr --max-rmse 0
says '^flip -?nan$'

# sequences
expect 0 render cornell "${small[@]}" --out 'a%02d.exr' --image direct --frames 0:3 --fps 5
expect 0 render cornell "${small[@]}" --out 'b%d.exr' --image direct --frames 0:3 --fps 4
expect 0 compare 'a%02d.exr' 'b%d.exr' --frames 0:3 --each --diff 'd%d.png' --map signed
says '^flicker [0-9.]+$'
[ "$(grep -c '^frame ' out)" = 21 ] || fail 'seven numbers for each of three frames'
[ -s d0.png ] && [ -s d2.png ] || fail 'no map of each frame'
if command -v python3 >/dev/null; then
    cp out sequence
    checks=$((checks + 1))
    python3 - <<'PYTHON' 2>err || fail 'the means are not those of the frames'
lines = [line.split() for line in open('sequence')]
frames = {}
for _, _, name, value in (line for line in lines if line[0] == 'frame'):
    frames.setdefault(name, []).append(float(value))
totals = {line[0]: float(line[1]) for line in lines if len(line) == 2}
for name, values in frames.items():
    expected = max(values) if name == 'max' else sum(values) / 3
    assert abs(totals[name] - expected) <= 1e-7 * expected, (name, totals[name], expected)
PYTHON
fi
expect 0 compare 'a%02d.exr' 'a%02d.exr' --frames 0:3 --max-flicker 0
expect 1 compare 'a%02d.exr' a00.exr --frames 0:3 --max-flicker 1e-6
expect 0 compare 'a%02d.exr' a01.exr --frames 1:2 --max-rmse 0
refused 'two frames' compare 'a%02d.exr' a00.exr --frames 1:2 --max-flicker 1
refused 'there is no file a03.exr' compare 'a%02d.exr' 'b%d.exr' --frames 0:4
refused 'holds a frame' compare a.exr b.exr --frames 0:2
refused 'put %04d' compare 'a%02d.exr' 'b%d.exr' --frames 0:2 --diff d.png
refused 'may stand for' compare 'a%s.exr' 'b%d.exr' --frames 0:2
refused 'A:B is expected' compare a.exr b.exr --frames 2

# one of a file's images
expect 0 reference cornell --size 16x12 --spp 2 --bounces 2 --out truth.exr
expect 0 reference cornell --size 16x12 --spp 2 --bounces 2 --out bounce.exr --image bounce-2
expect 0 render cornell "${small[@]}" --size 16x12 --out radiance.exr --image radiance
expect 0 compare truth.exr bounce.exr --image bounce-2 --max-max 0
expect 0 compare bounce.exr truth.exr --image bounce-2 --max-max 0
expect 1 compare bounce.exr truth.exr --image bounce-1 --max-max 0
expect 0 compare radiance.exr truth.exr
cp out main_image
expect 0 compare radiance.exr truth.exr --image radiance
cmp -s out main_image || fail 'the main image of a reference is its radiance'
refused 'it has radiance, bounce-1, bounce-2, direct-error, direct' compare bounce.exr truth.exr --image bounce-3
refused 'the name is empty' compare bounce.exr truth.exr --image ''

expect 0 render cornell "${small[@]}" --size 32x48 --out other.exr --image direct
refused 'equal sizes' compare a.exr other.exr
refused 'two images' compare a.exr
refused 'third' compare a.exr a.exr a.exr
refused 'missing.exr' compare a.exr missing.exr
refused 'letter.glb' compare letter.glb a.exr
refused 'empty.glb' compare a.exr empty.glb
head -c 200 a.exr >cut.exr
refused 'cut.exr' compare a.exr cut.exr
refused '--max-rmse small' compare a.exr b.exr --max-rmse small
refused 'value must follow' compare a.exr b.exr --max-rmse
refused 'did you mean --max-flip' compare a.exr b.exr --max-flop 1
refused 'did you mean --diff' compare a.exr b.exr --dif x.png
refused 'signed, flip' compare a.exr b.exr --map heat
refused '--scale 0' compare a.exr b.exr --scale 0
refused '--threads 0' compare a.exr b.exr --threads 0
refused 'no directory' compare a.exr b.exr --diff nowhere/d.png
refused 'must end in' compare a.exr b.exr --diff d.txt

# ---- play without a display ------------------------------------------------------------------------------------------
expect 0 play cornell "${small[@]}" --frames 0:2
[ -s frames/cornell-0000.png ] && [ -s frames/cornell-0001.png ] || fail 'play leaves no frames'
says 'frames/cornell-0000\.png'
[ "$(wc -l <out)" = 1 ] || fail 'play says in one line where the frames are'
expect 0 play "${small[@]}"
[ "$(find frames -name 'cornell-*.png' | wc -l)" = 60 ] || fail 'play leaves 60 frames of the default scene'
expect 0 play cornell "${small[@]}" --out 'p%d.png' --frames 0:1
[ -s p0.png ] || fail 'play --out'
mkdir sealed
: >sealed/frames
(
    cd sealed || exit 1
    TMPDIR=$work/folder timeout 120 "$program" play cornell "${small[@]}" --frames 0:1 >../out 2>../err
) || fail 'play where no frames can be written'
says "$work/folder/earthshine-.*/cornell-0000\.png"
refused 'missing.glb' play missing.glb

# ---- bench -----------------------------------------------------------------------------------------------------------
refused 'unknown benchmark' bench sped
refused 'did you mean gbuffer-70k' bench speed --only gbuffer-7k
refused '--runs 0' bench speed --runs 0
refused 'cannot be written' bench speed --out /proc/self
expect 0 bench speed --runs 1 --no-peer --only gbuffer-70k --out figures
says '^gbuffer-70k +[0-9.]+ ms '
for file in speed.json speed.csv speed-targets.svg index.html; do [ -s figures/$file ] || fail "no $file"; done
expect 0 bench frame --runs 1 --no-peer --out figures
expect 0 bench bounces --quick --only bounce-2-cornell --size 48x32 --spp 2 --threads 2 --out figures
refused 'did you mean micro-refit' bench micro --only micro-refi
expect 0 bench micro --quick --no-peer --size 48x32 --spp 2 --threads 2 --out figures --only micro-sixteenth --only micro-refit --only micro-error-cornell --only micro-equal-time-contact-cornell --only micro-ring-ggx-0.2
says '^micro-error-cornell +[0-9.]+ relRMSE'
expect 0 bench lamps --quick --size 48x32 --spp 2 --threads 2 --only lamps-curved-512 --only lamps-sky-error-maps
says '^lamps-curved-512 +[0-9.]+ ms '
expect 0 bench compensation --quick --threads 2 --only compensation-step-cornell --only compensation-samples --only compensation-energy-layers-crease-3 --out figures
says '^compensation-samples +[0-9.]+ patches +[0-9.]+ '
says '^compensation-energy-layers-crease-3 +[0-9.]+ % '
expect 0 bench reflections --quick --threads 2 --only reflections-error-lens-maps
says '^reflections-error-lens-maps +[0-9.]+ % '
expect 0 bench second-order --quick --threads 2 --out figures
says '^second-order-low-share +[0-9.]+ % '
expect 0 bench combinations --quick --size 48x32 --spp 2 --threads 2 --only combinations-crease
says '^combinations-crease +[0-9.]+ relRMSE +[0-9.]+ +[0-9.]+x '
expect 0 bench scale --quick --only scale-threads --size 64x48 --threads 2 --out figures
says '^scale-threads +[0-9.]+ x '
refused '--spp 1' bench error --spp 1
refused '--size 0x5' bench error --size 0x5
refused "nearest is 'cornell'" bench error --scene cornel --out figures
refused "nearest is 'cornell'" bench ledger --scene cornel --out figures
expect 0 bench ledger --quick --scene cornell --size 48x32 --spp 32 --out figures
says '^ledger-cornell-total +[0-9.]+ relRMSE'
says '^cornell: the .* most, .* unexplained'
expect 0 bench error --quick --no-peer --scene cornell --size 48x32 --spp 2 --out figures
says '^error-cornell-best +[0-9.]+ relRMSE'
[ "$(find figures/references -name 'cornell-*.exr' | wc -l)" = 8 ] || fail 'truths are not kept: two halves of a picture and of three frames'
if command -v python3 >/dev/null; then
    checks=$((checks + 1))
    python3 - <<'PYTHON' >out 2>err || fail 'the files of bench are not as described'
import glob, json, re, xml.etree.ElementTree as tree
for name in ('speed', 'frame', 'error', 'micro', 'compensation', 'second-order', 'scale', 'ledger'):
    report = json.load(open(f'figures/{name}.json'))
    assert set(report['machine']) >= {'processor', 'isa', 'threads', 'compiler', 'commit'}, report['machine']
    assert report['date'].startswith('20') and report['rows'], report
    for row in report['rows']:
        assert set(row) >= {'id', 'value', 'unit', 'peer', 'peer_value', 'ratio'}, row
row, = json.load(open('figures/speed.json'))['rows']
assert row['id'] == 'gbuffer-70k' and row['value'] > 0 and row['unit'] == 'ms' and row['ratio'] is None, row
error = json.load(open('figures/error.json'))
assert {row['id'] for row in error['rows']} >= {'reference-room-0.05', 'references-agree', 'indirect-50ms'}
assert len(error['points']) >= 10, len(error['points'])
for point in error['points']:
    assert set(point) >= {'scene', 'series', 'label', 'settings', 'ms', 'relrmse', 'relmse', 'flip', 'flip_whole', 'flicker'}, point
    assert point['scene'] == 'cornell' and point['ms'] > 0 and point['flip'] >= 0, point
assert [plot['id'] for plot in error['plots']][:3] == ['cornell-error', 'cornell-flip', 'cornell-flicker']
assert all(plot['headline'] for report in (error,) for plot in report['plots'])
micro = {row['id']: row for row in json.load(open('figures/micro.json'))['rows']}
assert set(micro) == {'micro-sixteenth', 'micro-refit', 'micro-error-cornell', 'micro-equal-time-contact-cornell', 'micro-ring-ggx-0.2'}, set(micro)
assert micro['micro-sixteenth']['value'] > 0 and micro['micro-sixteenth']['must'] == 6 and micro['micro-refit']['aim'] == 8
assert micro['micro-ring-ggx-0.2']['peer_value'] > 0, micro
scale = json.load(open('figures/scale.json'))
assert all(point['axis'] == 'threads' and point['ms'] >= max(point['passes'].values()) for point in scale['points']) and scale['points']
rows = {row['id']: row['value'] for row in json.load(open('figures/ledger.json'))['rows']}
causes = ['temporal', 'number', 'interleave', 'visibility', 'bound', 'light-view', 'quantisation', 'unexplained']
shares = [rows['ledger-cornell-' + cause] for cause in causes]
assert min(abs(sum(shares[:-1]) + sign * shares[-1] - 100) for sign in (1, -1)) < 1e-4, shares  # of the last one the size
assert abs(sum(rows[f'ledger-cornell-{cause}-relative'] for cause in causes) - 100) < 1e-4, rows
assert abs(rows['ledger-cornell-temporal']) < 0.01 and rows['ledger-cornell-total'] > 0, rows
for drawing in glob.glob('figures/*.svg'):
    tree.parse(drawing)
text = open('figures/index.html').read()
page = tree.fromstring(text)  # well-formed as XML too
assert [s.get('id') for s in page.iter('section')] == ['error', 'ledger', 'bounces', 'micro', 'compensation', 'second-order', 'scale', 'speed', 'frame'], 'a run keeps the sections of others'
names = {element.tag for element in page.iter()}
assert not names & {'script', 'link', 'iframe', 'object', 'image', 'use'}, names
assert not re.search(r'https?:|url\(|@import|src="(?!data:image/png;base64,)', text), 'the page loads something'
ids = [element.get('id') for element in page.iter() if element.get('id')]
assert len(ids) == len(set(ids)), 'an id is there twice'
for link in page.iter('a'):
    assert link.get('href')[1:] in ids, link.get('href')
for word in ('compiler', 'commit', 'threads', 'instruction set', 'UTC'):
    assert word in text, word
PYTHON
fi

# ---- soak ---------------------------------------------------------------------------------------------------------------
expect 0 soak --scene cornell-stack --seconds 2 --threads 1
says '^cornell-stack +17 bodies +0 soft bodies, 2 s, .*: good$'
expect 0 soak --scene curtain --seconds 0.5 --threads 2
says '^curtain .* [1-9][0-9]* soft bod.*: good$'
refused "no built-in scene is named 'nope'" soak --scene nope
refused --seconds soak --seconds -1
refused '--threads 65: a number from 1 to 64' soak --threads 65
# a while of every scene but those that are left out: with cloth, which takes long, or whose bodies gain energy
without_soak=' curtain ring stress '
for scene in $("$program" scenes | awk '{print $1}'); do
    case "$without_soak" in *" $scene "*) continue ;; esac
    expect 0 soak --scene "$scene" --seconds 3 --threads 2
done

echo "$checks checks, $failures failed"
[ $failures -eq 0 ]
