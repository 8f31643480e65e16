#!/bin/sh
# What one more task costs in instructions, whatever else the machine does: valgrind's count of TASKS
# tasks, taken from that of twice as many.
# Usage: tests/bench/instructions.sh CASE TASKS [build/tests/bench/task_cost]
set -eu
if [ $# -lt 2 ]; then sed -n 's/^# Usage/usage/p' "$0" >&2; exit 2; fi
count() {
  valgrind --tool=callgrind --callgrind-out-file=/dev/null "$program" "$1" "$2" 2>&1 |
    sed -n 's/.*Collected : //p'
}
program=${3:-build/tests/bench/task_cost}
few=$(count "$1" "$2")
many=$(count "$1" $((2 * $2)))
echo "$1: $(((many - few) / $2)) instructions a task"
