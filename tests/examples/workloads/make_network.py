"""Makes net.onnx, a small network for net.yaml: python3 make_network.py (Debian: python3-onnx)."""
import numpy
from onnx import TensorProto, checker, helper, numpy_helper, save

values = numpy.random.default_rng(1).standard_normal
weights = numpy_helper.from_array(values((8, 3, 3, 3)).astype(numpy.float32), "weights")
picture = helper.make_tensor_value_info("picture", TensorProto.FLOAT, [1, 3, 64, 64])
features = helper.make_tensor_value_info("features", TensorProto.FLOAT, [1, 8, 32, 32])
nodes = [
    helper.make_node("Conv", ["picture", "weights"], ["edges"], kernel_shape=[3, 3], pads=[1, 1, 1, 1]),
    helper.make_node("Relu", ["edges"], ["bright"]),
    helper.make_node("MaxPool", ["bright"], ["features"], kernel_shape=[2, 2], strides=[2, 2]),
]
graph = helper.make_graph(nodes, "net", [picture], [features], [weights])
model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)])
checker.check_model(model)
save(model, "net.onnx")
