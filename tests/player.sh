#!/usr/bin/env bash
# The player, by keyboard and mouse in a window on a screen that nobody sees: every check looks at what came of it, a picture, a title, the
# settings it prints.
# usage: player.sh BUILD_DIR SOURCE_DIR
set -u
build=$(cd "$1" && pwd)
source=$(cd "$2" && pwd)
program=$build/earthshine
for tool in Xvfb xdotool; do
    if ! command -v $tool >/dev/null; then
        echo "skipped: $tool is not installed"
        exit 77
    fi
done
if [ ! -x "$program" ]; then
    echo "skipped: the program is not built (EARTHSHINE_DEMOS)"
    exit 77
fi
work=$(mktemp -d)
screen=
player=
compositor=
end()
{
    [ -n "$player" ] && kill "$player" 2>/dev/null
    [ -n "$compositor" ] && kill "$compositor" 2>/dev/null
    [ -n "$screen" ] && kill "$screen" 2>/dev/null
    wait 2>/dev/null
    rm -rf "$work"
}
trap end EXIT
cd "$work" || exit 1
checks=0
failures=0

fail()
{
    failures=$((failures + 1))
    echo "FAILED: $1"
    tail -n 3 out 2>/dev/null | sed 's/^/    stdout: /'
    tail -n 3 err 2>/dev/null | sed 's/^/    stderr: /'
}

# eventually COMMAND…: until it succeeds; a loaded machine may take its time
eventually()
{
    local i
    for ((i = 0; i < 200; i++)); do
        "$@" >/dev/null 2>&1 && return 0
        kill -0 "$player" 2>/dev/null || return 1
        sleep 0.1
    done
    return 1
}
check()
{
    local what=$1
    shift
    checks=$((checks + 1))
    eventually "$@" || fail "$what"
}

# Xvfb chooses a display that is free and writes its number
mkfifo number
Xvfb -noreset -displayfd 3 -screen 0 1280x1024x24 -nolisten tcp 3>number >xvfb.log 2>&1 &
screen=$!
read -r -t 30 display <number || {
    echo "skipped: Xvfb does not start"
    exit 77
}
export DISPLAY=:$display
unset WAYLAND_DISPLAY

small=(--set vpl.count=64 --set ism.points=1024 --set ism.pool=65536 --set ism.size=32 --set shadow.size=256)

# play ARGUMENTS…: the player's window is $window
play()
{
    "$program" play "$@" >out 2>err </dev/null &
    player=$!
    local i
    window=
    for ((i = 0; i < 300; i++)); do
        window=$(xdotool search --onlyvisible --name '^Earthshine' 2>/dev/null | head -n 1)
        [ -n "$window" ] && break
        kill -0 $player 2>/dev/null || break
        sleep 0.1
    done
    if [ -z "$window" ]; then
        fail "no window: $*"
        return 1
    fi
    xdotool windowmove "$window" 0 0 windowfocus "$window"
    sleep $delay
    pace
}
# quits by the keyboard; the program must end well
quit()
{
    checks=$((checks + 1))
    key ctrl+q
    local i
    for ((i = 0; i < 150; i++)); do
        kill -0 "$player" 2>/dev/null || break
        sleep 0.1
    done
    if kill -0 "$player" 2>/dev/null; then
        fail 'it does not quit'
        kill "$player"
    fi
    wait "$player"
    local code=$?
    [ $code -eq 0 ] || fail "exit $code"
    player=
}
# longer than a frame, so that each key is seen by itself; set anew by `pace` for each window
delay=0.15
key()
{
    local k
    for k in "$@"; do
        if [[ $k == ctrl+* ]]; then
            xdotool keydown ctrl
            sleep $delay
            xdotool key "${k#ctrl+}"
            sleep $delay
            xdotool keyup ctrl
        else
            xdotool key "$k"
        fi
        sleep $delay
    done
}
# How long the player takes to answer tells how loaded the machine is.
pace()
{
    local before from
    before=$(pictures png)
    from=$(date +%s%N)
    xdotool key F9
    eventually eval "[ \$(pictures png) -gt $before ]" || fail 'no screenshot'
    delay=$(awk -v ns=$(($(date +%s%N) - from)) 'BEGIN { s = 1.5 * ns / 1e9; print (s < 0.12 ? 0.12 : (s > 1.5 ? 1.5 : s)) }')
}
# the settings as the player prints them: a line more on each call
settings()
{
    local before
    before=$(wc -l <out)
    key ctrl+s
    eventually eval "[ \$(wc -l <out) -gt $before ]" || fail 'no settings are printed'
    tail -n 1 out
}
has() { [[ " $2 " == *" $1 "* ]]; }
pictures() { find pictures -name "*.$1" 2>/dev/null | wc -l; }
# shot: a new PNG, named in $picture
shot()
{
    local before
    before=$(pictures png)
    key F9
    checks=$((checks + 1))
    eventually eval "[ \$(find pictures -name '*.png' | wc -l) -gt $before ]" || fail 'no screenshot'
    picture=$(ls -t pictures/*.png | head -n 1)
}
different() { ! "$program" compare "$1" "$2" --max-rmse 0.002 >/dev/null 2>&1; }
alike() { "$program" compare "$1" "$2" --max-rmse 0.002 >/dev/null 2>&1; }

# ---- keys, panels, settings ------------------------------------------------------------------------------------------
if play cornell --size 640x480 "${small[@]}"; then
    key space # still, so that pictures can be compared
    shot
    first=$picture
    shot
    checks=$((checks + 1))
    alike "$first" "$picture" || fail 'a paused scene changes'
    key m o t h ctrl+m # every panel
    shot
    checks=$((checks + 1))
    alike "$first" "$picture" || fail 'panels are in the picture'
    key ctrl+m h t m Escape
    line=$(settings)
    checks=$((checks + 1))
    has '--set vpl.count=64' "$line" || fail "the settings lack what was given: $line"

    # faster than frames come: every press counts
    xdotool key --delay 1 equal equal equal equal equal equal equal equal
    sleep $delay
    line=$(settings)
    checks=$((checks + 1))
    has '--set exposure=2' "$line" || fail "eight presses of + are not two stops: $line"
    xdotool key --delay 1 minus minus minus minus minus minus minus minus

    # a setting found by its name, stepped by the arrow keys
    key slash
    xdotool type --delay $(awk -v d=$delay 'BEGIN { print int(d * 1000) }') 'exposure'
    key Down Down Right Right
    line=$(settings)
    checks=$((checks + 1))
    has '--set exposure=0.02' "$line" || [[ $line == *' --set exposure='* ]] || fail "an arrow key does not change a setting: $line"
    shot
    # typed as a number
    key Return
    xdotool type --delay $(awk -v d=$delay 'BEGIN { print int(d * 1000) }') '2.5'
    key Return
    line=$(settings)
    checks=$((checks + 1))
    has '--set exposure=2.5' "$line" || fail "a typed value is not taken: $line"
    shot
    checks=$((checks + 1))
    different "$first" "$picture" || fail 'a setting changes nothing'
    # and reset
    key Delete
    line=$(settings)
    checks=$((checks + 1))
    [[ $line != *exposure* ]] || fail "Delete does not reset: $line"
    key Escape
    shot
    checks=$((checks + 1))
    alike "$first" "$picture" || fail 'the picture does not come back with its settings'

    # split: the former settings on the right
    key plus plus plus plus
    shot
    bright=$picture
    key b
    shot
    checks=$((checks + 1))
    different "$bright" "$picture" || fail 'the split shows nothing of the former settings'
    key b b minus minus minus minus

    # time: one step, then back
    shot
    before=$picture
    key n n n n n n n n n n n n
    shot
    checks=$((checks + 1))
    different "$before" "$picture" || fail 'single steps do not move the scene'
    key bracketleft bracketleft bracketleft bracketleft bracketleft bracketleft bracketleft bracketleft bracketleft bracketleft bracketleft bracketleft
    shot
    checks=$((checks + 1))
    alike "$before" "$picture" || fail 'winding back does not lead back'

    # a float picture, a sequence
    key F10
    check 'no EXR' eval '[ $(find pictures -name "*.exr" | wc -l) -eq 1 ]'
    key F12
    check 'no sequence' eval '[ $(find pictures -name "cornell-01-*.png" | wc -l) -ge 3 ]'
    key F12

    # another scene, from the menu, by keyboard: the second entry
    key m
    sleep $delay
    key Down Return
    check 'the menu opens no scene' eval '[ "$(xdotool getwindowname $window)" = "Earthshine: room" ]'
    quit
fi

# ---- mouse -----------------------------------------------------------------------------------------------------------
if play cornell --size 640x480 "${small[@]}"; then
    key space
    shot
    first=$picture
    # a drag in the picture turns the camera; the drag beside the panels' places
    xdotool mousemove 320 240 mousedown 1
    sleep $delay
    xdotool mousemove 380 250
    sleep $delay
    xdotool mouseup 1
    sleep $delay
    shot
    checks=$((checks + 1))
    different "$first" "$picture" || fail 'a drag does not turn the camera'
    key r
    shot
    checks=$((checks + 1))
    alike "$first" "$picture" || fail 'R does not lead back to the camera of the scene'

    # the light, held by the keyboard
    key k
    xdotool keydown Left
    sleep 0.8; sleep $delay
    xdotool keyup Left
    sleep $delay
    shot
    checks=$((checks + 1))
    different "$first" "$picture" || fail 'the light does not move'
    key Escape ctrl+j
    shot
    checks=$((checks + 1))
    alike "$first" "$picture" || fail 'the light does not come home'

    # a click on the bar opens the settings, a drag of a slider there changes one
    xdotool mousemove 70 8 click 1
    sleep $delay
    before=$(settings)
    xdotool mousemove 500 104 mousedown 1
    sleep $delay
    xdotool mousemove 560 104
    sleep $delay
    xdotool mouseup 1
    sleep $delay
    after=$(settings)
    checks=$((checks + 1))
    [ "$before" != "$after" ] || fail "a slider that is dragged changes nothing: $after"
    quit
fi

# ---- bodies: one is taken from the stack; wound back and left alone it stays; all of it is recorded and replayed ---------
if play cornell-stack --size 640x480 "${small[@]}" --image instance --record stack.rec --set world.speed=0.01 --set antialias=none; then
    key space c # before the ball comes; then at the usual speed, step by step
    shot
    first=$picture
    xdotool mousemove 285 266 mousedown 1
    sleep $delay
    xdotool mousemove 360 180
    sleep $delay
    key n n n n n n n n n n n n
    shot
    held=$picture
    xdotool mouseup 1
    key bracketleft bracketleft bracketleft bracketleft bracketleft bracketleft bracketleft bracketleft bracketleft bracketleft bracketleft bracketleft
    shot
    checks=$((checks + 1))
    alike "$first" "$picture" || fail 'winding back does not undo what the hand did'
    key n n n n n n n n n n n n
    shot
    checks=$((checks + 1))
    different "$held" "$picture" || fail 'the hand moves no body'
    key f # whatever is in the middle, or nothing
    quit
    for arguments in '' '--threads 1 --isa scalar'; do
        checks=$((checks + 1))
        # shellcheck disable=SC2086
        "$program" render --replay stack.rec $arguments >out 2>err || fail "the replay is another: $arguments"
    done
fi
if play --replay stack.rec --size 320x240; then
    line=$(settings)
    checks=$((checks + 1))
    [[ $line == 'cornell-stack '* ]] || fail "the replay is of another scene: $line"
    quit
fi

# ---- reflections: a handle is moved, that is undone and done again, saved, and rendered without a window to the same picture ------
still=("${small[@]}" --set antialias=none --set temporal=false --set vpl.stable=false --set reflections.size=64)
if play rokeby --size 320x240 "${still[@]}"; then
    key space backslash
    shot
    first=$picture
    key ctrl+e ctrl+h ctrl+h # the green handle of the scene's constraint
    xdotool keydown Down
    sleep 0.8; sleep $delay
    xdotool keyup Down
    key Escape
    shot
    moved=$picture
    checks=$((checks + 1))
    different "$first" "$moved" || fail 'a handle that is moved changes no reflection'
    key ctrl+z
    shot
    checks=$((checks + 1))
    alike "$first" "$picture" || fail 'Ctrl Z does not undo it'
    key ctrl+y
    shot
    checks=$((checks + 1))
    alike "$moved" "$picture" || fail 'Ctrl Y does not do it again'
    key bracketright backslash # what is edited is no part of the time that is wound
    shot
    checks=$((checks + 1))
    alike "$moved" "$picture" || fail 'winding back takes an edit away'
    key ctrl+w
    check 'the edits are not saved' test -s rokeby-edits.gltf
    key F10
    check 'no EXR screenshot' eval '[ -n "$(find pictures -name "rokeby*.exr")" ]'
    "$program" render rokeby --size 320x240 "${still[@]}" --edits rokeby-edits.gltf --image radiance --out edited.exr >/dev/null 2>err
    checks=$((checks + 1))
    "$program" compare edited.exr pictures/rokeby*.exr --max-max 0 >/dev/null || fail 'without a window the saved edits make another picture'
    key ctrl+n ctrl+g ctrl+k ctrl+f ctrl+v Escape
    quit
fi

# ---- a constraint on glass is one of refraction ---------------------------------------------------------------------------------------
cat >pane.gltf <<'GLTF'
{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "name": "pane"}],
 "extensionsUsed": ["KHR_materials_transmission"], "materials": [{"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}}],
 "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
 "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-1, -1, -3], "max": [1, 1, -3]},
               {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}],
 "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 12}],
 "buffers": [{"byteLength": 60, "uri": "data:application/octet-stream;base64,AACAvwAAgL8AAEDAAACAPwAAgL8AAEDAAACAPwAAgD8AAEDAAACAvwAAgD8AAEDAAAABAAIAAAACAAMA"}]}
GLTF
if play pane.gltf --size 320x240 "${small[@]}"; then
    key ctrl+n ctrl+w
    check 'a constraint on glass is none of refraction' grep -q refraction pane-edits.gltf
    quit
fi

# ---- Wayland: a compositor in a window of the same screen, which gives the player all of it ------------------------------
wayland()
{
    command -v weston >/dev/null || { echo "no Wayland: weston is not installed"; return; }
    local glfw i
    glfw=$(bash "$source/demos/install-packages" wayland "$build/glfw-wayland") || { echo "no Wayland: no GLFW for it"; return; }
    export XDG_RUNTIME_DIR=$work/run
    mkdir -m 700 "$XDG_RUNTIME_DIR"
    weston --backend=x11-backend.so --shell=kiosk-shell.so --no-config --width=800 --height=600 --socket=earthshine --idle-time=0 >weston.log 2>&1 &
    compositor=$!
    for ((i = 0; i < 100; i++)); do
        [ -S "$XDG_RUNTIME_DIR/earthshine" ] && break
        sleep 0.1
    done
    [ -S "$XDG_RUNTIME_DIR/earthshine" ] || { echo "no Wayland: weston does not start"; return; }
    DISPLAY= WAYLAND_DISPLAY=earthshine LD_LIBRARY_PATH=$glfw "$program" play cornell --size 640x480 "${small[@]}" >out 2>err </dev/null &
    player=$!
    for i in $(xdotool search --onlyvisible --name '.*' 2>/dev/null); do
        [[ $(xdotool getwindowname "$i") == Weston* ]] && xdotool windowmove "$i" 0 0 windowfocus "$i"
    done
    xdotool mousemove 300 300
    sleep 2
    pace
    key space # the first press may come before the window is there
    shot
    local first=$picture
    key plus plus plus plus
    shot
    checks=$((checks + 1))
    different "$first" "$picture" || fail 'a key does nothing on Wayland'
    xdotool mousemove 400 300 mousedown 1
    sleep $delay
    xdotool mousemove 460 310
    sleep $delay
    xdotool mouseup 1
    sleep $delay
    first=$picture
    shot
    checks=$((checks + 1))
    different "$first" "$picture" || fail 'the mouse does nothing on Wayland'
    quit
}
wayland

echo "$checks checks, $failures failures"
[ $failures -eq 0 ]
