#!/usr/bin/env bash
# The checks that take longer than tools/check.sh may: the round trip of .blend files that the project did not make, of the
# fixtures against Cycles, and of the light that glTF drops in the next Blender too; pictures in EEVEE.
#
# usage: tools/long_check.sh [DIR]   keeps pictures and reports in DIR (default: target/long)
# Needs what tools/check.sh needs, after it ran once; Debian's package assimp-testmodels, fetched with apt-get, for the
# foreign scenes; and OpenGL (libegl1, libgl1-mesa-dri) for EEVEE. About 20 minutes on two cores.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
out=${1:-target/long}
mkdir -p "$out"
passed=0 failed=0

run() { # NAME PYTHON ARGUMENTS...: one round trip, counted by its closing line
  local name=$1 python=$2 good bad
  shift 2
  printf '\n== %s\n' "$name"
  "$python" tools/roundtrip.py --keep "$out/$name" --report "$out/$name.json" "$@" 2>&1 | tee "$out/$name.log" |
    grep -v -E '^(Fra:|Saved|Time|Read blend|Warning: region)|INFO|Baking|^$'
  read -r good bad < <(sed -n 's/.*round trip: \([0-9]*\) passed, \([0-9]*\) failed.*/\1 \2/p' "$out/$name.log")
  passed=$((passed + ${good:-0})) failed=$((failed + ${bad:-1}))
}

blender4=target/venv/bin/python
blender5=target/venv5/bin/python
if ! "$blender5" -c 'import bpy' 2>/dev/null; then
  "$blender4" -m venv --clear target/venv5
  "$blender5" -m pip install --quiet --disable-pip-version-check 'bpy==5.0.*' 'numpy==1.26.*' 'OpenEXR==3.*'
fi

models=$out/foreign-scenes/usr/share/assimp/models/BLEND
if [[ ! -d $models ]]; then
  mkdir -p "$out/foreign-scenes"
  (cd "$out/foreign-scenes" && apt-get download -qq assimp-testmodels && dpkg -x assimp-testmodels_*.deb .)
fi
foreign=()
for name in AreaLight_269 BlenderDefault_276 HUMAN TorusLightsCams_250_compressed 4Cubes4Mats_248; do
  foreign+=("$models/$name.blend")
done

run foreign "$blender4" --views --cycles 256 "${foreign[@]}"
run fixtures "$blender4" --views --cycles 512 fixtures/{cornell,window_room,corridor,leaves}.glb
run light-4 "$blender4" --own --views --cycles 1024 --page-size 96
run light-5 "$blender5" --own --views --cycles 512 --page-size 96
run eevee "$blender4" --views --eevee fixtures/{cornell,corridor}.glb

printf '\n%d passed, %d failed\n' "$passed" "$failed"
((failed == 0))
