#!/usr/bin/env bash
# Synthesizes each core, and each bitstream's cores together, for the DE1-SoC's Cyclone V, and writes fit.txt. Needs yosys; takes minutes; no
# part of the build.
#
#   workloads/backends/fpga/synthesize.sh [NAME...]     only these, without writing
#
# ALMs: the larger of ALUT6 + half of the smaller ALUTs and of the adders, plus half an ALM a MLAB, and of a quarter of the flip-flops.
# DSP blocks: 27x27 whole, 18x18 half, 9x9 a third. Clock: half of what the slowest path allows, which leaves as much for wires as for logic.
set -euo pipefail
export LC_ALL=C
cd "$(dirname "$0")"
readonly tops=(gaussian_blur convolution sobel undistort feature_score optical_flow vision mac_array)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

synthesize() {
  local cells='read_verilog -specify -lib -D cyclonev'
  for part in alm dff dsp mem; do cells+=" +/intel_alm/common/${part}_sim.v"; done
  yosys -q -l "$scratch/$1.log" -p "read_verilog cores/*.v
    synth_intel_alm -family cyclonev -noiopad -noclkbuf -top $1
    tee -q -o $scratch/$1.cells stat
    $cells
    tee -q -o $scratch/$1.paths sta" >"$scratch/$1.out" 2>&1 || { cat "$scratch/$1.out" >&2; return 1; }
}

row() {
  awk -v name="$1" '
    FNR == 1 { ++file }
    file == 1 && $1 ~ /^(MISTRAL_|\$)/ { n[$1] = $2 }
    file == 2 && /^Latest arrival time/ { arrival = $NF + 0 }
    END {
      for (cell in n) if (cell !~ /^MISTRAL_(ALUT[2-6]|ALUT_ARITH|NOT|FF|MLAB|M10K|MUL(27X27|18X18|9X9))$/) {
        print name ": no rule for a cell " cell > "/dev/stderr"; exit 1
      }
      half = n["MISTRAL_ALUT2"] + n["MISTRAL_ALUT3"] + n["MISTRAL_ALUT4"] + n["MISTRAL_ALUT5"] + n["MISTRAL_ALUT_ARITH"]
      alms = n["MISTRAL_ALUT6"] + half / 2 + n["MISTRAL_MLAB"] / 2
      if (alms < n["MISTRAL_FF"] / 4) alms = n["MISTRAL_FF"] / 4
      dsp = n["MISTRAL_MUL27X27"] + n["MISTRAL_MUL18X18"] / 2 + n["MISTRAL_MUL9X9"] / 3
      printf "%-14s %6.0f %6.1f %5d %6d %6.1f\n", name, alms, dsp, n["MISTRAL_M10K"], arrival, 1e6 / (2 * arrival)
    }' "$scratch/$1.cells" "$scratch/$1.paths"
}

table() {
  printf 'cores %s\n' "$(cat cores/*.v | sha256sum | cut -c1-16)"
  printf 'tool  %s\n' "$(yosys -V | cut -d'(' -f1)"
  printf '%-14s %6s %6s %5s %6s %6s\n' top alms dsp m10k ps mhz
  printf '%-14s %6s %6s %5s\n' 5CSEMA5 32070 87 397
  for top in "$@"; do
    synthesize "$top"
    row "$top"
  done
}

if [[ $# -gt 0 ]]; then
  table "$@"
else
  table "${tops[@]}" >"$scratch/fit.txt"
  mv "$scratch/fit.txt" fit.txt
  cat fit.txt
fi
