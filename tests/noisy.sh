#!/usr/bin/env bash
# The demo's steps beside two busy loops a core: four modes, a sentence, and no dash where a figure exists.
#
# Usage: tests/noisy.sh PIRT
set -euo pipefail
pirt=$(realpath "${1:?usage: tests/noisy.sh PIRT}")
out=$(mktemp -d)
loops=()
trap 'kill "${loops[@]}" 2>/dev/null; wait 2>/dev/null; rm -rf "$out"' EXIT
for ((i = 0; i < 2 * $(nproc); ++i)); do
  (while :; do :; done) &
  loops+=($!)
done

fail() { echo "noisy: $*" >&2; cat "$out/report.txt" >&2 || true; exit 1; }
# ask SQL FILE: of a JSON file, which the query calls document.
ask() { sqlite3 :memory: "WITH file(document) AS (SELECT CAST(readfile('$out/$2') AS TEXT)) $1"; }

cd "$out"
"$pirt" characterize --quick --db profile.db >characterize.log
for mode in latency throughput energy advanced; do
  "$pirt" schedule --mode "$mode" --profile profile.db --json "$mode.json" >"$mode.log"
done
"$pirt" report compare profile.db --json report.json >report.txt
"$pirt" report text profile.db {latency,throughput,energy,advanced}.json -o report.log
"$pirt" report page profile.db {latency,throughput,energy,advanced}.json -o report.html

[[ $(head -n 3 report.txt) =~ (Take|No\ mode\ keeps\ up\.\ Take)\ [a-z]+ ]] || fail "no sentence says which mode to take"
[[ $(ask "SELECT group_concat(json_extract(value, '\$.mode'), ' ') FROM file, json_each(document, '\$.runs')" report.json) == \
  "latency throughput energy advanced" ]] || fail "not all four modes ran"
measured=$(sqlite3 profile.db "SELECT count(DISTINCT workload) FROM profile_summary WHERE phase = 'call' AND reasons = ''")
shown=$(ask "SELECT count(*) FROM file, json_each(document, '\$.preferable') WHERE json_extract(value, '\$.by_time.preferable') <> '-'" report.json)
[[ $measured -gt 0 && $shown -eq $measured ]] || fail "$measured workloads have a figure, $shown are shown"
echo "noisy: $(head -n 3 report.txt | grep -m 1 Take)"
