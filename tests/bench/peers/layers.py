"""AlexNet's layers by cuDNN and cuBLAS through PyTorch, as pirt computes them: f32 (no TF32), batch 1, and the whole chain of
1, 16 and 64 images. Prints "WORKLOAD US" a line: the median of rounds of calls in a row, for build/tests/bench/device --peers."""
import torch
import torch.nn.functional as F

torch.backends.cuda.matmul.allow_tf32 = False
torch.backends.cudnn.allow_tf32 = False
torch.backends.cudnn.benchmark = True
CONVOLUTIONS = {  # channels in, size, channels out, kernel, stride, padding
    "conv1": (3, 227, 96, 11, 4, 0),
    "conv2": (96, 27, 256, 5, 1, 2),
    "conv3": (256, 13, 384, 3, 1, 1),
    "conv4": (384, 13, 384, 3, 1, 1),
    "conv5": (384, 13, 256, 3, 1, 1),
}
MATRICES = {"fc6": (9216, 4096), "fc7": (4096, 4096), "fc8": (4096, 1000)}


def timed(name, call, in_a_row, rounds=15):
    for _ in range(10):
        call()
    times = []
    for _ in range(rounds):
        begin, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
        begin.record()
        for _ in range(in_a_row):
            call()
        end.record()
        end.synchronize()
        times.append(begin.elapsed_time(end) / in_a_row * 1e3)
    print(f"{name} {sorted(times)[len(times) // 2]:.2f}", flush=True)


def random(*shape):
    return torch.randn(*shape, device="cuda") * 0.03


layers = {}
with torch.no_grad():
    for name, (channels, size, out, kernel, stride, pad) in CONVOLUTIONS.items():
        layers[name] = weights, bias, *_ = random(out, channels, kernel, kernel), random(out), stride, pad
        x = random(1, channels, size, size)
        timed(name, lambda: torch.relu_(F.conv2d(x, weights, bias, stride, pad)), 200)
    for name, (inputs, outputs) in MATRICES.items():
        layers[name] = weights, bias = random(outputs, inputs), random(outputs)
        x = random(1, inputs)
        last = (lambda y: torch.softmax(y, 1)) if name == "fc8" else (lambda y: y)
        timed(name, lambda: last(F.linear(x, weights, bias)), 200)

    def chain(x):
        for name in CONVOLUTIONS:
            x = torch.relu_(F.conv2d(x, *layers[name]))
            if name in ("conv1", "conv2", "conv5"):
                x = F.max_pool2d(x, 3, 2)
        x = x.flatten(1)
        for name in MATRICES:
            x = F.linear(x, *layers[name])
        return torch.softmax(x, 1)

    for images in (1, 16, 64):
        picture = random(images, 3, 227, 227)
        timed("alexnet" if images == 1 else f"alexnet@batch{images}", lambda: chain(picture), 20)
