#!/usr/bin/env bash
# The checks that take longer than tools/check.sh may; `tools/check.sh --long` runs them after its own.
#
# usage: tools/long_check.sh [MINUTES [DIR]]   fuzzes for MINUTES in all (default: 60), keeps pictures, reports and crashes
#                                              in DIR (default: target/long)
#        tools/long_check.sh --only PART...    parts: fuzz kills debug memory miri effects blender
# fuzz     every target of fuzz/ in turn, from the fixtures and, where they lie beside the project, scenes of others
# kills    500 bakes killed instead of 50, 20,000 damaged files instead of 1,500
# debug    the tests of the numeric stages with debug assertions, which check the laws after every step of every solver,
#          and with checks of integer overflow
# memory   valgrind's memcheck over what calls xatlas, which is C++, and over bakes of damaged files; xatlas alone under
#          AddressSanitizer and UndefinedBehaviorSanitizer with random meshes, for five minutes; Rust and C++ together under
#          AddressSanitizer, in the tests of the stages, of damaged files and of bakes
# miri     the unit tests of what is Rust alone under Miri, which interprets them and finds undefined behaviour
# effects  instructions of bakes with and without the code of effects that the scene does not call for
# blender  round trips of .blend files that the project did not make, of the fixtures against Cycles, and of the light that
#          glTF drops in the next Blender too; pictures in EEVEE
#
# Installs cargo-fuzz into target/tools, Miri into the nightly toolchain and, where apt-get is there, valgrind. Fuzzing,
# sanitizing and Miri need that toolchain (`rustup toolchain install nightly`). The part `blender` needs what tools/check.sh
# needs, after it ran once; Debian's package assimp-testmodels, fetched with apt-get, for the foreign scenes; and OpenGL
# (libegl1, libgl1-mesa-dri) for EEVEE; it takes about 20 minutes on two cores.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
minutes=60 out=target/long parts=(fuzz kills debug memory miri effects blender)
if [[ ${1-} == --only ]]; then
  shift
  parts=("$@")
else
  minutes=${1:-$minutes} out=${2:-$out}
fi
mkdir -p "$out"
out=$(realpath "$out")
passed=0 failed=0

count() { passed=$((passed + $1)) failed=$((failed + $2)); }

check() { # NAME COMMAND ARGUMENTS...: counts as one
  local name=$1
  shift
  printf '\n== %s\n' "$name"
  if "$@"; then count 1 0; else
    count 0 1
    printf -- '-- %s: FAILED\n' "$name"
  fi
}

fuzz() {
  local fuzzer=target/tools/bin/cargo-fuzz target share
  if ! cargo +nightly --version >/dev/null 2>&1; then
    printf 'fuzzing needs a nightly toolchain: rustup toolchain install nightly\n' >&2
    return 1
  fi
  [[ -x $fuzzer ]] || cargo install --quiet --locked --root target/tools cargo-fuzz || return
  # Bakes with their pages in them are the seeds of what reads bakes.
  cargo build --release --quiet || return
  mkdir -p "$out/bakes"
  for fixture in fixtures/{grey_lamp,blend_glass,emissive_texture,closed_furnace}.glb; do
    target/release/lightkiln bake "$fixture" -o "$out/bakes/$(basename "$fixture")" --embed --quality draft -q \
      --page-size 64 --max-pages 1 || return
  done
  python3 fuzz/seeds.py "$out/seeds" fixtures "$out/bakes" ../shared/scenes 2>/dev/null || return
  local good=0
  for share in import:10 plan:10 atlas:15 bake:45 baked:10 sky:10; do
    target=${share%:*}
    local seconds=$((minutes * 60 * ${share#*:} / 100)) kind=scenes
    [[ $target == sky ]] && kind=pictures
    mkdir -p "$out/corpus/$target" "$out/crashes"
    printf -- '-- fuzz %s for %d s\n' "$target" "$seconds"
    if PATH="$PWD/target/tools/bin:$PATH" cargo +nightly fuzz run -s none "$target" "$out/corpus/$target" "$out/seeds/$kind" -- \
      -max_total_time="$seconds" -timeout=60 -rss_limit_mb=4096 -max_len=40000 -print_final_stats=1 \
      -artifact_prefix="$out/crashes/$target-" 2>"$out/fuzz-$target.log"; then
      good=$((good + 1))
      grep -E 'stat::(number_of_executed_units|peak_rss)' "$out/fuzz-$target.log"
      grep -o 'cov: [0-9]*' "$out/fuzz-$target.log" | tail -n 1
    else
      tail -n 30 "$out/fuzz-$target.log"
    fi
  done
  ((good == 6))
}

kills() {
  LIGHTKILN_KILLS=500 LIGHTKILN_FUZZ=100000 LIGHTKILN_DAMAGED=20000 \
    cargo test --release --test faults --test bad_input --lib -- killed damage no_bytes
}

debug() {
  # Of this package alone: what it depends on stays as it was built.
  cargo test --release --config 'profile.release.package.lightkiln.debug-assertions=true' \
    --config 'profile.release.package.lightkiln.overflow-checks=true' --lib --test solvers --test stability \
    --test determinism --test plan --test gather --test form_factors --test bad_input -- --skip speed
}

sanitize() { # SECONDS
  local manifest
  manifest=$(cargo metadata --locked --format-version 1 |
    python3 -c 'import json, sys; print(next(p["manifest_path"] for p in json.load(sys.stdin)["packages"] if p["name"] == "xatlas-rs-v2"))') || return
  g++ -std=c++14 -O1 -g -w -DNDEBUG -DXA_MULTITHREADED=0 -fsanitize=address,undefined -fno-sanitize-recover=undefined \
    -I "$(dirname "$manifest")/vendor/source/xatlas" -o "$out/xatlas" fuzz/xatlas.cpp && "$out/xatlas" "$1"
}

# Everything that is Rust, and xatlas with it. Nightly: sanitizers are not yet in stable Rust.
sanitize_rust() {
  local host
  host=$(rustc -vV | sed -n 's/^host: //p')
  local test=(cargo +nightly test --release --target "$host" --target-dir target/asan)
  # Tests of speed would measure the sanitizer; those of claims limit the address space, of which it takes terabytes.
  local -x RUSTFLAGS=-Zsanitizer=address CXXFLAGS=-fsanitize=address CARGO_INCREMENTAL=0 LIGHTKILN_DAMAGED=300
  "${test[@]}" --lib --test determinism -- --skip speed && "${test[@]}" --test bad_input damage
}

memory() {
  command -v valgrind >/dev/null || { apt-get install -y -qq valgrind >/dev/null || return; }
  local unit property
  # Valgrind knows no AVX-512 and is slow: the tests that measure speed are left out.
  unit=$(cargo test --release --no-run --lib 2>&1 | sed -n 's/.*(\(target.*\))$/\1/p')
  property=$(cargo test --release --no-run --test bad_input 2>&1 | sed -n 's/.*(\(target.*\))$/\1/p')
  local grind=(valgrind --quiet --error-exitcode=9 --leak-check=full --errors-for-leak-kinds=definite)
  "${grind[@]}" "$unit" atlas:: --skip speed --test-threads 1 &&
    LIGHTKILN_DAMAGED=60 "${grind[@]}" "$property" damaged --test-threads 1 &&
    sanitize 300 && sanitize_rust
}

# Miri interprets, some thousand times slower than a processor: tests of trees do a little of what they do else, see `tries`
# in src/transport/tests. Left out: what calls xatlas, which is C++; what hands work to threads, since crossbeam is not made
# for the rules of Stacked Borrows; what decodes pictures or bakes; and whatever takes minutes without touching more memory.
undefined() {
  cargo +nightly miri --version >/dev/null 2>&1 || rustup component add miri rust-src --toolchain nightly || return
  local modules=(transport::tests:: sampling:: units:: text:: report:: elements::clip elements::spot gather::interpolate
    solve::facets solve::queue solve::rows export::gltf::texcoord export::lookup export::uri plan::columns plan::lamps
    import::accessor import::container import::exponents import::extensions import::json import::primitive
    import::uri::tests::decodes import::uri::tests::refuses atlas::coverage atlas::metric check::layout
    hemicube::tests::an_open polygon::tests::degenerate polygon::tests::touching polygon::tests::a_receiver
    sobol::tests::different)
  local left_out=(many_names_for_one_accessor the_patch_found_has_nearly collecting_gives the_transposed_of_many)
  local -x MIRIFLAGS=-Zmiri-disable-isolation PROPTEST_CASES=2
  # Miri asks the build, not the processor, for wide instructions.
  [[ $(uname -m) != x86_64 ]] || local -x RUSTFLAGS='-C target-feature=+avx2,+fma,+bmi1'
  cargo +nightly miri test --lib -- "${modules[@]}" "${left_out[@]/#/--skip=}"
}

round_trip() { # NAME PYTHON ARGUMENTS...: counted by its closing line
  local name=$1 python=$2 good bad
  shift 2
  printf '\n== %s\n' "$name"
  "$python" tools/roundtrip.py --keep "$out/$name" --report "$out/$name.json" "$@" 2>&1 | tee "$out/$name.log" |
    grep -v -E '^(Fra:|Saved|Time|Read blend|Warning: region)|INFO|Baking|^$'
  read -r good bad < <(sed -n 's/.*round trip: \([0-9]*\) passed, \([0-9]*\) failed.*/\1 \2/p' "$out/$name.log")
  count "${good:-0}" "${bad:-1}"
}

blender() {
  local blender4=target/venv/bin/python blender5=target/venv5/bin/python
  if ! "$blender5" -c 'import bpy' 2>/dev/null; then
    "$blender4" -m venv --clear target/venv5
    "$blender5" -m pip install --quiet --disable-pip-version-check 'bpy==5.0.*' 'numpy==1.26.*' 'OpenEXR==3.*'
  fi
  local models=$out/foreign-scenes/usr/share/assimp/models/BLEND name foreign=()
  if [[ ! -d $models ]]; then
    mkdir -p "$out/foreign-scenes"
    (cd "$out/foreign-scenes" && { apt-get download -qq assimp-testmodels || { apt-get update -qq; apt-get download -qq assimp-testmodels; }; } &&
      dpkg -x assimp-testmodels_*.deb .)
  fi
  for name in AreaLight_269 BlenderDefault_276 HUMAN TorusLightsCams_250_compressed 4Cubes4Mats_248; do
    foreign+=("$models/$name.blend")
  done
  round_trip foreign "$blender4" --views --cycles 256 "${foreign[@]}"
  round_trip fixtures "$blender4" --views --cycles 512 fixtures/{cornell,window_room,corridor}.glb
  # On coarser pages its shadows are smaller than a texel and met by chance: 3 % too bright at 128².
  round_trip leaves "$blender4" --views --cycles 64 --page-size 512 fixtures/leaves.glb
  round_trip light-4 "$blender4" --own --views --cycles 1024 --page-size 96
  round_trip light-5 "$blender5" --own --views --cycles 512 --page-size 96
  round_trip eevee "$blender4" --views --eevee fixtures/{cornell,corridor}.glb
}

for part in "${parts[@]}"; do
  case $part in
    fuzz) check "fuzzing, $minutes min" fuzz ;;
    kills) check "kills and damage" kills ;;
    debug) check "debug assertions" debug ;;
    memory) check "valgrind and sanitizers" memory ;;
    miri) check "Miri" undefined ;;
    effects) check "code of absent effects" python3 tools/absent_effects.py ;;
    blender) blender ;;
    *)
      printf 'there is no part %s\n' "$part" >&2
      exit 2
      ;;
  esac
done

printf '\n%d passed, %d failed\n' "$passed" "$failed"
((failed == 0))
