"""A program as a workload: the mean of a cloud of points, asked by lines of JSON (workloads/own/README.md)."""
import json
import mmap
import os
import struct
import sys

hello = json.loads(sys.stdin.readline())
memory = mmap.mmap(os.open(hello["memory"], os.O_RDWR), hello["bytes"])
tensors = {tensor["name"]: tensor for tensor in hello["tensors"]}
rows = tensors["cloud"]["shape"][0]


def answer(line):
    print(json.dumps(line), flush=True)


answer({"ready": True})
for line in sys.stdin:
    asked = json.loads(line)
    if "null" in asked:
        answer({"done": asked["null"]})
        continue
    points = struct.unpack_from(f"{3 * rows}f", memory, tensors["cloud"]["offset"])
    means = [sum(points[axis::3]) / rows for axis in range(3)]
    struct.pack_into("3f", memory, tensors["mean"]["offset"], *means)
    answer({"done": asked["call"]})
