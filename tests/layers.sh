#!/usr/bin/env bash
# The house rules that a compiler does not check: a floor includes and calls only floors below it; a third party's header is
# included in its one file; the library keeps no mutable state of file scope, defines no global name without its prefix,
# exports what its headers declare and nothing else, and calls none of libm's functions, whose results differ between
# machines.
# usage: layers.sh BUILD_DIR SOURCE_DIR
set -u
build=$1
source=$2
if [ ! -d "$build" ] || [ ! -d "$source" ] || [ "$build" -ef "$source" ]; then
    echo "layers.sh: '$build', '$source': a build directory and another one, of the sources, are needed" >&2
    exit 2
fi
cd "$source" || exit 1
status=0
fail()
{
    echo "FAILED: $*"
    status=1
}

floors="platform raster sim gi"
declare -A rank=([platform]=0 [raster]=1 [sim]=2 [gi]=3) # of whatever else: 9

# ---- text -------------------------------------------------------------------------------------------------------------

# shellcheck disable=SC2086
files=$(find $floors demos tests -type f \( -name '*.c' -o -name '*.h' -o -name '*.cpp' -o -name '*.inl' -o -name '*.sh' -o -name '*.cmake' \))
# report WHAT: file:line: from grep
report()
{
    while IFS=: read -r file line _; do fail "$file:$line: $1"; done
}
# shellcheck disable=SC2086
{
    report "a tab" < <(grep -n $'\t' $files CMakeLists.txt)
    report "a carriage return" < <(grep -n $'\r' $files CMakeLists.txt)
    report "blanks at the end of a line" < <(grep -nE ' +$' $files CMakeLists.txt)
}
for file in $files CMakeLists.txt; do
    [ -n "$(tail -c 1 "$file")" ] && fail "$file: the last line has no line feed"
done

# ---- includes ---------------------------------------------------------------------------------------------------------

# C11, POSIX and intrinsics may be included anywhere; these nowhere but in one file.
plain='^(assert|ctype|errno|fenv|float|inttypes|limits|locale|math|setjmp|signal|stdalign|stdarg|stdatomic|stdbool|stddef|stdint|stdio|stdlib|stdnoreturn|string|strings|time|wchar|dirent|dlfcn|fcntl|libgen|poll|pthread|sched|semaphore|unistd|sys/[a-z]+|immintrin|emmintrin|xmmintrin|smmintrin|cpuid|arm_neon|xlocale)\.h$'
declare -A only_in=(
    ['^(openexr|Imf|Iex|Imath|OpenEXR/).*']=platform/image_exr.c
    ['^(png|pngconf)\.h$|^libpng.*']=platform/image_png.c
    ['^GLFW/.*']=platform/window.c
    ['^(X11|xcb)/.*|^sys/(ipc|shm)\.h$']=platform/window.c
    ['^zlib\.h$']=platform/image_exr_dwa.c
    ['^(tiny_gltf|stb_.*|json)\.(h|hpp)$|^nlohmann/.*']=sim/import_gltf.cpp
)
include='^[[:space:]]*#[[:space:]]*include[[:space:]]*[<"]([^>"]+)[>"]'
while IFS=: read -r file line text; do
    floor=${file%%/*} name=$text
    [[ $text =~ $include ]] && name=${BASH_REMATCH[1]}
    from_floor=
    case $name in
    earthshine/*) from_floor=${name#earthshine/} from_floor=${from_floor%.h} ;;
    platform/* | raster/* | sim/* | gi/* | demos/* | tests/*) from_floor=${name%%/*} ;;
    esac
    case $floor in
    platform | raster | sim | gi)
        if [ -n "$from_floor" ]; then
            [ "${rank[$from_floor]:-9}" -le "${rank[$floor]:-9}" ] || fail "$file:$line: $floor/ must not include $name: a floor includes only floors below"
            continue
        fi
        ;;
    demos)
        case $name in
        platform/* | raster/* | sim/* | gi/* | tests/*) fail "$file:$line: demos/ must not include $name: people use the public headers, <earthshine/…>" ;;
        esac
        ;;
    esac
    for pattern in "${!only_in[@]}"; do
        if [[ $name =~ $pattern ]]; then
            if [ "$file" != "${only_in[$pattern]}" ] && [ "$floor" != tests ]; then
                fail "$file:$line: $name may be included in ${only_in[$pattern]} only"
            fi
            continue 2
        fi
    done
    if [[ $text == *"<"* && -z $from_floor && $floor != tests && $floor != demos && ! $name =~ $plain && ! ($file == *.cpp && $name =~ ^[a-z_]+$) ]]; then
        fail "$file:$line: <$name> is neither of the C library, nor POSIX, nor a third party with a file of its own"
    fi
done < <(grep -nE '^[[:space:]]*#[[:space:]]*include[[:space:]]*[<"]' $files)

for header in $floors; do
    grep -nE '#include "' "$header/$header.h" && fail "$header/$header.h is installed and must include others as <earthshine/…>"
done
cpp_files=$(find $floors demos tests -name '*.cpp' -o -name '*.cc' -o -name '*.cxx' -o -name '*.hpp' | tr '\n' ' ')
case $cpp_files in
"" | "sim/import_gltf.cpp ") ;;
*) fail "C++ files besides sim/import_gltf.cpp: $cpp_files" ;;
esac

# ---- objects ----------------------------------------------------------------------------------------------------------

# Of the library's build folders, without what is left there of files that are gone.
objects=$(find "$build/CMakeFiles/earthshine.dir" "$build"/CMakeFiles/earthshine_kernels_*.dir -name '*.o' 2>/dev/null |
    while read -r object; do
        from=${object#"$build"/CMakeFiles/*.dir/}
        [ -f "$source/${from%.o}" ] && echo "$object"
    done)
[ -n "$objects" ] || fail "no object files in $build: build the library first"
importer=import_gltf.cpp

# Names of libm's functions, by the library itself; of these only the exactly rounded square root is allowed.
libm=$(gcc -print-file-name=libm.so.6 2>/dev/null)
[ -f "$libm" ] || libm=$(find /lib /usr/lib -name 'libm.so.6' 2>/dev/null | head -n 1)
libm_names=$build/libm_names.txt
nm -D --defined-only "$libm" | awk '{ sub(/@.*/, "", $3); print $3 }' | grep -E '^[a-z]' | sort -u | grep -vxE 'sqrtf?' >"$libm_names"

# Every symbol of every object, once: FILE NAME CLASS SECTION. The state of a file lies in .data*, .bss* or COMMON, but for
# .data.rel.ro, which is constant once the loader has filled in its addresses.
symbols=$build/symbols.txt
# shellcheck disable=SC2086
nm -A -f sysv $objects | tr -d ' ' | awk -F'|' -v strip="$build/CMakeFiles/" '
    NF >= 7 {
        at = index($1, ".o:")
        file = substr($1, 1, at - 1)
        file = substr(file, length(strip) + 1)
        sub(/^[^\/]*\//, "", file)
        name = substr($1, at + 3)
        sub(/@.*/, "", name)
        print file, name, $3, ($7 == "" ? "-" : $7), $4
    }' >"$symbols"

# what C++ needs to throw and catch, and what the inline functions of its library and of tinygltf keep (a null value, guards),
# is the importer's to have
state=$(awk '$4 ~ /^(\.(data|bss|tdata|tbss)|.*COM)/ && $4 !~ /^\.data\.rel\.ro/ && $5 != "SECTION" && $2 !~ /^\./ { print $1, $2 }' "$symbols" |
    grep -vE "$importer (_ZStL8__ioinit|_Z(GV)?Z*NK?(St|9__gnu_cxx|8nlohmann|8tinygltf).*|DW\.ref\.[^ ]*)$")
while read -r file name; do
    [ -n "$file" ] && fail "$file keeps state of file scope: $name"
done <<<"$state"

# inline functions and templates that C++ puts into every object are weak; a user's own copy of them is the same
strangers=$(awk '$3 ~ /^[A-TV-Zu]$/ && $2 !~ /^es_/ { print $1, $2, $3 }' "$symbols" |
    grep -vE "$importer (_Z[^ ]* [WVu]|DW\.ref[^ ]* V)$")
while read -r file name _; do
    [ -n "$file" ] && fail "$file defines a global name without the prefix es_: $name"
done <<<"$strangers"

# files are not pixels: the pictures that tinygltf would decode never reach this library
calls=$(awk 'NR == FNR { libm[$1] = 1; next } $3 == "U" && ($2 in libm) { print $1, $2 }' "$libm_names" "$symbols" |
    grep -vE "$importer (pow|ldexp|frexp|floor|round)$")
while read -r file name; do
    [ -n "$file" ] && fail "$file calls libm: $name"
done <<<"$calls"

# A declaration written by hand would get around the rule for includes.
upward=$(awk '
    BEGIN { rank["platform"] = 0; rank["raster"] = 1; rank["sim"] = 2; rank["gi"] = 3 }
    { floor = $1; sub(/\/.*/, "", floor) }
    NR == FNR { if ($3 != "U" && $2 ~ /^es_/ && $3 ~ /^[A-Z]$/) of[$2] = floor; next }
    $3 == "U" && ($2 in of) && rank[of[$2]] > rank[floor] { print $1, $2, of[$2] }' "$symbols" "$symbols")
while read -r file name floor; do
    [ -n "$file" ] && fail "$file uses $name of $floor/, a floor above"
done <<<"$upward"

# ---- exports ----------------------------------------------------------------------------------------------------------

# shellcheck disable=SC2086
declared=$(cat platform/platform.h raster/raster.h sim/sim.h gi/gi.h | grep -E '^ES_API ' | sed -nE 's/^ES_API [^(]*[ *](es_[a-z0-9_]+)\(.*/\1/p' | sort)
# shellcheck disable=SC2086
if gcc -shared -o "$build/exports.so" -Wl,--unresolved-symbols=ignore-all $objects 2>"$build/exports.log"; then
    exported=$(nm -D --defined-only "$build/exports.so" | awk '$2 !~ /[WVu]/ { print $3 }' | grep -vE '^_(init|fini)$' | sort)
    missing=$(comm -23 <(echo "$declared") <(echo "$exported") | tr '\n' ' ')
    extra=$(comm -13 <(echo "$declared") <(echo "$exported") | tr '\n' ' ')
    [ -n "$missing" ] && fail "declared in a public header but not defined: $missing"
    [ -n "$extra" ] && fail "exported but in no public header: $extra"
    rm -f "$build/exports.so"
else
    fail "the objects do not link as a shared library: $(head -n 1 "$build/exports.log")"
fi

[ $status -eq 0 ] && echo "$(wc -w <<<"$objects") objects and $(wc -w <<<"$files") files keep the house rules"
exit $status
