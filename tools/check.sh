#!/usr/bin/env bash
# Runs every check of the project: format, lints, tests, and a round trip of baked fixtures through Blender and the
# Khronos validator, and pages of studies through a browser. Installs what it needs into target/venv and tools/node_modules, and Debian's
# chromium where there is none and it may. Exit code 0: everything passed.
#
# usage: tools/check.sh [--long [MINUTES [DIR]]]   --long goes on with tools/long_check.sh: fuzzing for MINUTES (default: 60),
#                                                  kills, assertions, sanitizers, scenes of others; what is kept goes to DIR
#
# Needs cargo, g++, npm and Python 3.11; the first run fetches Blender as a Python module (about 300 MB).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

passed=0 failed=0
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

heading() { printf '\n== %s\n' "$1"; }
count() { passed=$((passed + $1)) failed=$((failed + $2)); }
give_up() {
  printf 'cannot check: %s\n' "$1" >&2
  exit 1
}

# A check that counts as one.
check() {
  local name=$1 started=$SECONDS
  shift
  heading "$name"
  if "$@"; then
    count 1 0
    printf -- '-- %s: ok, %d s\n' "$name" $((SECONDS - started))
  else
    count 0 1
    printf -- '-- %s: FAILED, %d s\n' "$name" $((SECONDS - started))
  fi
}

# A command that counts for itself; its output has lines of the form "... N passed, N failed" or cargo's "N passed; N failed".
# Where it fails without having counted anything as failed, that is one failure.
counted_check() {
  local name=$1 started=$SECONDS status=0 good bad
  shift
  heading "$name"
  "$@" 2>&1 | tee "$work/output" || status=$?
  read -r good bad < <(awk '
    match($0, /[0-9]+ passed[;,] [0-9]+ failed/) { split(substr($0, RSTART), word, " "); good += word[1]; bad += word[3] }
    END { print good + 0, bad + 0 }' "$work/output")
  if ((status != 0 && bad == 0)); then bad=1; fi
  count "$good" "$bad"
  printf -- '-- %s: %d passed, %d failed, %d s\n' "$name" "$good" "$bad" $((SECONDS - started))
}

find_python() {
  local name
  for name in python3.11 python3 python; do
    if "$name" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null; then
      printf '%s\n' "$name"
      return
    fi
  done
  give_up "Python 3.11 is missing (Blender 4.5 as a module is built for this version)"
}

set_up_blender() {
  local python=target/venv/bin/python found
  # The copy of the requirements is left behind last, so it tells whether the environment is whole and current.
  if ! cmp -s tools/requirements.txt target/venv/requirements.txt; then
    found=$(find_python)
    "$found" -m venv --clear target/venv
    "$python" -m pip install --quiet --disable-pip-version-check -r tools/requirements.txt
    cp tools/requirements.txt target/venv/requirements.txt
  fi
  if ! "$python" -c 'import bpy' >/dev/null 2>"$work/import"; then
    # Blender links the libraries of a desktop even when it draws nothing.
    if grep -q 'cannot open shared object file' "$work/import" && ((EUID == 0)) && command -v apt-get >/dev/null; then
      apt-get update -qq
      apt-get install -y -qq libxi6 libxxf86vm1 libxfixes3 libxrender1 libgl1 libxkbcommon0 libsm6 libice6 >/dev/null
    fi
    "$python" -c 'import bpy' >/dev/null || give_up "Blender's Python module does not load, see above"
  fi
}

set_up_validator() {
  if [[ tools/package-lock.json -nt tools/node_modules/.package-lock.json ]]; then
    npm ci --prefix tools --loglevel=error --no-audit --no-fund
  fi
}

set_up_browser() {
  if [[ -z ${CHROMIUM:-} ]] && ! [[ -x /usr/bin/chromium || -x /usr/bin/chromium-browser || -x /usr/bin/google-chrome ]]; then
    ((EUID == 0)) && command -v apt-get >/dev/null || give_up "Chromium is missing: apt-get install chromium, or name yours by CHROMIUM"
    apt-get update -qq
    apt-get install -y -qq chromium >/dev/null
  fi
}

# Small studies of every kind, and their pages as a browser shows them; screenshots stay in target/pages.
study_pages() {
  local studies="$work/studies" program=target/release/lightkiln
  "$program" study effects fixtures/grey_lamp.glb --page-size 64 --quality draft --out "$studies" >/dev/null
  "$program" study accuracy fixtures/grey_lamp.glb --page-size 48 --out "$studies" >/dev/null 2>"$work/study" ||
    { tail -n 20 "$work/study"; return 1; }
  node tools/check_pages.mjs --screenshots target/pages "$studies"/*.html
}

# Bakes every fixture and examines the result; a fixture that cannot be baked counts as failed and takes no part in what follows.
bake_fixtures() {
  local fixture out good=0 bad=0
  for fixture in fixtures/*.glb; do
    out="$work/$(basename "$fixture")"
    if target/release/lightkiln bake "$fixture" -o "$out" --preview "${out%.glb}.preview.glb" \
      --page-size 256 --quality draft -q && [[ -s $out ]] && target/release/lightkiln check "$out" >"$work/findings"; then
      good=$((good + 1))
      pairs+=("$fixture" "$out")
    else
      bad=$((bad + 1))
      printf 'FAIL  %s could not be baked, or its bake is not sound\n' "$fixture"
      grep '^error' "$work/findings" || true
    fi
  done
  count "$good" "$bad"
  printf -- '-- bake: %d passed, %d failed\n' "$good" "$bad"
}

for tool in cargo g++ npm; do
  command -v "$tool" >/dev/null || give_up "$tool is missing"
done

# One profile throughout, so that nothing is compiled twice without need.
check "format" cargo fmt --check
check "lints" cargo clippy --release --all-targets -- -D warnings
counted_check "tests" cargo test --release --no-fail-fast

heading "set up Blender, the validator and the browser"
set_up_blender
set_up_validator
set_up_browser

heading "bake the fixtures"
pairs=()
if cargo build --release --quiet; then
  bake_fixtures
else
  count 0 1
fi
if ((${#pairs[@]})); then
  counted_check "round trip through Blender" target/venv/bin/python tools/roundtrip.py --views --pairs "${pairs[@]}"
  counted_check "Khronos validator" node tools/validate_gltf.mjs --baseline "${pairs[@]}"
fi
counted_check "pages of studies" study_pages
counted_check "plans in Blender" target/venv/bin/python tools/check_plan.py fixtures/*.glb
# Every kind of light that glTF drops, exported, baked, and baked again by Cycles.
counted_check "light as in Cycles" target/venv/bin/python tools/roundtrip.py --own --cycles 128 --page-size 64

if [[ ${1-} == --long ]]; then
  check "long checks" tools/long_check.sh "${@:2}"
fi

printf '\n%d passed, %d failed\n' "$passed" "$failed"
((failed == 0))
