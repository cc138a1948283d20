#!/usr/bin/env bash
# Indentation and blanks as .clang-format has them, in every C file. Where a line breaks is left to whoever writes it, and so
# are columns lined up by hand (tables, matrices, comments at the ends of lines): a line is compared with clang-format's only
# if that has the same line up to blanks, and continuations, macros and runs of blanks inside a line are not compared.
# Other versions of clang-format judge differently, so this skips without version 14.
# usage: format.sh BUILD_DIR SOURCE_DIR
set -u
cd "$2" || exit 1
tool=
for candidate in clang-format-14 clang-format; do
    if command -v $candidate >/dev/null && $candidate --version | grep -q 'version 14\.'; then
        tool=$candidate
        break
    fi
done
if [ -z "$tool" ] || ! command -v python3 >/dev/null; then
    echo "skipped: clang-format 14 or python3 is not installed"
    exit 77
fi
# shellcheck disable=SC2046
python3 - $tool $(find platform raster sim gi demos tests -name '*.c' -o -name '*.h' -o -name '*.inl' -o -name '*.cpp') <<'PYTHON'
import difflib, re, subprocess, sys

options = dict(line.rstrip('\n').split(': ', 1) for line in open('.clang-format') if ': ' in line)
options['ColumnLimit'] = '0'
style = '{' + ', '.join(f'{name}: {value}' for name, value in options.items()) + '}'


def without_comment(line):
    return re.sub(r'\s*(/\*.*?\*/|//.*)$', '', line)


def blanks_as_compared(line):
    line = without_comment(line)
    indentation = len(line) - len(line.lstrip())
    return line[:indentation] + re.sub(r' +', ' ', line.strip())


found = 0
for file in sys.argv[2:]:
    source = open(file, encoding='utf-8').read()
    formatted = subprocess.run([sys.argv[1], '--style=' + style, '--assume-filename=' + file.replace('.inl', '.c')],
                               input=source, capture_output=True, text=True, check=True).stdout
    a, b = source.split('\n'), formatted.split('\n')
    starts = []  # of a statement or declaration: what precedes has ended; a macro need not have ended it
    ended, in_macro = True, False
    for line in a:
        code = without_comment(line).strip()
        macro = in_macro or code.startswith('#')
        starts.append(ended and not macro)
        in_macro = macro and line.rstrip().endswith('\\')
        if code and not code.startswith('*'):
            ended = not macro and code[-1] in ';{}:'
    keys = [[re.sub(r'\s+', '', line) for line in lines] for lines in (a, b)]
    for i, j, n in difflib.SequenceMatcher(None, *keys, autojunk=False).get_matching_blocks():
        for k in range(n):
            if starts[i + k] and blanks_as_compared(a[i + k]) != blanks_as_compared(b[j + k]):
                found += 1
                print(f'FAILED: {file}:{i + k + 1}:\n{a[i + k]}\nshould be\n{b[j + k]}')
print(f'{len(sys.argv) - 2} files, {found} lines with other blanks than .clang-format has')
sys.exit(1 if found else 0)
PYTHON
