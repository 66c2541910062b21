"""A novice or an expert as ONNX, for whatever runs that: the whole network, trunks included, for batches of any size.

The inputs are called as the features are, float32 [n, *shape] in [0, 1]; `action` is [n, 2], linear and angular in
[-1, 1] of the robot's top speeds. A novice of `plus` also says its `deviation` [n, 2]; its metadata hold the `limit`
above which it knows less than in the runs that proved it.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy.typing import ArrayLike
from onnx import TensorProto, helper, numpy_helper

from lira.fusion.inference.architecture import KERNEL, Architecture, Weights
from lira.fusion.inference.checkpoint import Checkpoint
from lira.fusion.inference.kernel_net import ANGULAR, LITTLE, NOTHING, QUIET, UNDECIDED, kernel, parts, without
from lira.fusion.inference.layers import SLOPE
from lira.fusion.inference.networks import DrivingNet
from lira.fusion.preprocess import MODALITIES
from lira.hal.errors import StorageError

OPSET = 17
IR_VERSION = 8  # the format's, as old as that opset: older runtimes read it, too
LEAST_LENGTH = 1e-12  # a trunk that sees nothing stays zero instead of becoming nan


def write_onnx(network: DrivingNet, checkpoint: Checkpoint, path: Path) -> None:
    """Write a new file. Raises `StorageError`."""
    model = build(network, checkpoint)
    try:
        with path.open("xb") as file:
            file.write(model.SerializeToString())
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror}", "Choose another file.") from error


def build(network: DrivingNet, checkpoint: Checkpoint) -> onnx.ModelProto:
    """Make the model, with what the checkpoint says of itself as metadata."""
    what, weights = network.architecture, network.weights()
    graph = Graph()
    seen = [_trunk(graph, what, weights, name, name) for name in what.shapes]
    about = {name: value if isinstance(value, str) else json.dumps(value) for name, value in asdict(checkpoint).items()}
    outputs = ["action"]
    if what.kind == KERNEL:
        _kernel(graph, what, weights, seen)
        outputs.append("deviation")
        about["limit"] = json.dumps(float(weights["limit"][0]))
    else:
        _layers(graph, what, weights, seen)
    model = helper.make_model(
        helper.make_graph(
            graph.nodes,
            what.kind,
            [_value(name, shape) for name, shape in what.shapes.items()],
            [_value(name, (2,)) for name in outputs],
            graph.constants,
        ),
        producer_name="lira-rosbot",
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        doc_string=__doc__,
    )
    helper.set_model_props(model, about)
    onnx.checker.check_model(model, full_check=True)
    return model


class Graph:
    """Nodes and constants as they are added; each gives out one value, by its name."""

    def __init__(self) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self._constants: dict[str, onnx.TensorProto] = {}

    @property
    def constants(self) -> list[onnx.TensorProto]:
        """All of them, in order."""
        return list(self._constants.values())

    def constant(self, name: str, numbers: ArrayLike) -> str:
        """Add numbers; those that have this name already are the same."""
        self._constants.setdefault(name, numpy_helper.from_array(np.asarray(numbers, order="C"), name))
        return name

    def add(self, kind: str, inputs: Sequence[str], output: str | None = None, **attributes: Any) -> str:
        """Add a node and return the name of what it gives out."""
        output = output or f"{kind.lower()}_{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, list(inputs), [output], **attributes))
        return output

    def cast(self, x: str) -> str:
        """In single precision."""
        return self.add("Cast", [x], to=TensorProto.FLOAT)

    def column(self, x: str, k: int) -> str:
        """Column k of x [n, columns], [n, 1]."""
        return self.add("Gather", [x, self.constant(f"column_{len(self.nodes)}", np.array([k]))], axis=1)

    def dense(self, x: str, weights: Weights, layer: str) -> str:
        """y = W x + b."""
        named = [self.constant(name, weights[name]) for name in (f"{layer}.weight", f"{layer}.bias")]
        return self.add("Gemm", [x, *named], transB=1)

    def rectified(self, x: str) -> str:
        """Leaky rectifier."""
        return self.add("LeakyRelu", [x], alpha=float(SLOPE))


def _value(name: str, shape: Sequence[int]) -> onnx.ValueInfoProto:
    return helper.make_tensor_value_info(name, TensorProto.FLOAT, ["n", *shape])


def _trunk(graph: Graph, what: Architecture, weights: Weights, feature: str, seen: str) -> str:
    """What looks at one feature, as it was `seen`, [n, size]."""
    trunk = what.trunks[feature]
    if len(what.shapes[feature]) == 1:
        hidden = graph.rectified(graph.dense(seen, weights, f"{trunk}.fc1"))
        return graph.rectified(graph.dense(hidden, weights, f"{trunk}.fc2"))
    hidden = graph.add("Unsqueeze", [seen, graph.constant(f"{trunk}.channel", np.array([1]))])
    for layer in (f"{trunk}.conv1", f"{trunk}.conv2"):
        named = [graph.constant(name, weights[name]) for name in (f"{layer}.weight", f"{layer}.bias")]
        hidden = graph.rectified(graph.add("Conv", [hidden, *named]))
    pooled = graph.add("MaxPool", [hidden], kernel_shape=[2, 2], strides=[2, 2])
    return graph.add("Flatten", [pooled])


def _layers(graph: Graph, what: Architecture, weights: Weights, seen: Sequence[str]) -> None:
    """The layers behind the trunks, tanh at the end."""
    x = graph.add("Concat", seen, axis=1)
    for layer in what.layers[:-1]:
        x = graph.rectified(graph.dense(x, weights, layer))
    graph.add("Tanh", [graph.dense(x, weights, what.layers[-1])], "action")


def _kernel(graph: Graph, what: Architecture, weights: Weights, seen: Sequence[str]) -> None:
    """The regression of `fusion/policies/kernel.py`, in double precision as there."""
    pieces, widths = parts(what.trunk_sizes), weights["lengths"].astype(np.float64) ** 2
    covariance = kernel(weights["x"], weights["x"], pieces, widths) + np.diag(weights["noise"].astype(np.float64))
    p = np.linalg.inv(covariance)
    least, one = graph.constant("least", np.float32(LEAST_LENGTH)), graph.constant("one", np.float64(1.0))
    exponents = []
    for k, (name, part, width) in enumerate(zip(seen, pieces, widths, strict=True)):
        length = graph.add("Max", [graph.add("ReduceL2", [name], axes=[1], keepdims=1), least])
        unit = graph.add("Div", [name, length])
        likeness = graph.add("MatMul", [unit, graph.constant(f"x.{k}", weights["x"][:, part].T)])
        off = graph.add("Sub", [graph.add("Cast", [likeness], to=TensorProto.DOUBLE), one])
        exponents.append(graph.add("Div", [off, graph.constant(f"width.{k}", width)]))
    values = graph.add("Exp", [graph.add("Sum", exponents)])
    mean = graph.add("MatMul", [values, graph.constant("a", p @ weights["y"])])
    gains = graph.constant("gains", np.array([1.0, weights["gain"][0]], np.float32))
    turned = graph.add("Mul", [graph.cast(mean), gains])
    unknown = _unknown(graph, values, "p", p)
    if what.fallback:
        first, side, hesitation, asked, other = _advice(graph, what, weights, seen)
        w = unknown
        if what.asks:
            w = _unknown(graph, values, "p_of_others", without(p, weights["others"] < 1.0))
            rest = graph.add("Sub", [one, graph.add("Where", [asked, w, graph.constant("zero", np.float64(0.0))])])
            turned = graph.add("Mul", [turned, graph.cast(rest)])
        turned = graph.add("Add", [turned, graph.add("Mul", [graph.cast(w), first])])
        squares = graph.add("MatMul", [values, graph.constant("squares", p @ weights["y"][:, ANGULAR:] ** 2)])
        turned = _decided(graph, turned, weights["gain"], squares, _side_for(graph, turned, side, hesitation))
        if what.asks:
            turned = _made_up_for(graph, turned, unknown, other)
    limits = [graph.constant("low", np.float32(-1.0)), graph.constant("high", np.float32(1.0))]
    graph.add("Clip", [turned, *limits], "action")
    spread = graph.add("Sqrt", [unknown])
    scale = graph.constant("scale", weights["scale"])
    graph.add("Mul", [graph.cast(spread), scale], "deviation")


def _unknown(graph: Graph, values: str, name: str, p: ArrayLike) -> str:
    """What `unknown` says of kernel values [n, examples] and this P, [n, 1]."""
    known = graph.add("Mul", [graph.add("MatMul", [values, graph.constant(name, p)]), values])
    axis, one = graph.constant("examples", np.array([1])), graph.constant("one", np.float64(1.0))
    rest = graph.add("Sub", [one, graph.add("ReduceSum", [known, axis], keepdims=1)])
    return graph.add("Max", [rest, graph.constant("zero", np.float64(0.0))])


def _made_up_for(graph: Graph, action: str, unknown: str, other: str) -> str:
    """The action with its turn as `made_up_for` has it where another expert agrees with its side."""
    one, little = graph.constant("one", np.float64(1.0)), graph.constant("little", np.float64(LITTLE))
    known = graph.add("Max", [graph.add("Sub", [one, unknown]), graph.constant("nothing", np.float64(NOTHING))])
    factor = graph.add("Sqrt", [graph.add("Div", [little, graph.add("Min", [known, little])])])
    linear, turn = (graph.column(action, k) for k in (0, ANGULAR))
    agrees = graph.add("Greater", [graph.add("Mul", [turn, other]), graph.constant("none", np.float32(0.0))])
    larger = graph.add("Mul", [turn, graph.cast(graph.add("Where", [agrees, factor, one]))])
    return graph.add("Concat", [linear, larger], axis=1)


def _advice(graph: Graph, what: Architecture, weights: Weights, seen: Sequence[str]) -> tuple[str, str, str, str, str]:
    """What `Advice` says: the first expert's action and side where it is asked, whether another hesitates, whether it
    is asked, and how the one of the others turns that turns most, if it has something to say.
    """
    quiet, none = graph.constant("quiet", np.float32(QUIET)), graph.constant("none", np.float32(0.0))
    whole = [_away(graph, what, weights, name, x) for name, x in zip(what.shapes, seen, strict=True)]
    halves = [
        _away(graph, what, weights, name, _trunk(graph, what, weights, name, half))
        for name in list(what.shapes)[1:]
        for half in (_halves(graph, what, name) if what.halves else ())
    ]
    still = graph.add("Less", [_loudest(graph, none, [away for _, away in whole[1:]]), quiet])
    stirs = graph.add("GreaterOrEqual", [_loudest(graph, none, [away for _, away in halves]), quiet])
    hesitation = graph.add("And", [still, stirs])
    asked = graph.add("And", [still, graph.add("Not", [stirs])])
    action, away = whole[0]
    turn = graph.column(away, ANGULAR)
    speaks = graph.add("And", [asked, graph.add("GreaterOrEqual", [graph.add("Abs", [turn]), quiet])])
    side = graph.add("Where", [speaks, graph.add("Sign", [turn]), none]) if what.sides else none
    turns = [graph.column(away, ANGULAR) for _, away in whole[1:]]
    right, left = (graph.add(kind, [none, *turns]) for kind in ("Min", "Max"))
    most = graph.add("Where", [graph.add("Greater", [graph.add("Neg", [right]), left]), right, left])
    loud = graph.add("GreaterOrEqual", [graph.add("Abs", [most]), quiet])
    other = graph.add("Where", [loud, most, none])
    return graph.add("Where", [asked, action, none]), side, hesitation, asked, other


def _away(graph: Graph, what: Architecture, weights: Weights, feature: str, x: str) -> tuple[str, str]:
    """The action of the expert that sees a feature, by what its trunk made of it, and how far that is from cruising."""
    trunk = what.trunks[feature]
    action = graph.add("Tanh", [graph.dense(x, weights, f"{trunk}_out")])
    cruise = weights["cruise"][list(what.shapes).index(feature)]
    return action, graph.add("Sub", [action, graph.constant(f"{trunk}_cruise", cruise)])


def _halves(graph: Graph, what: Architecture, feature: str) -> list[str]:
    """What `Modality.halves` makes of a feature: where it frees what is zero, it frees whatever is there."""
    freed = MODALITIES[feature].halves(np.zeros(what.shapes[feature][-1], np.float32))
    halves = []
    for k, values in enumerate(freed):
        where = graph.constant(f"{feature}_half.{k}", values > 0.0)
        halves.append(graph.add("Where", [where, graph.constant(f"{feature}_free.{k}", values), feature]))
    return halves


def _loudest(graph: Graph, none: str, away: Sequence[str]) -> str:
    """The largest of all these numbers, or none, [n, 1]."""
    most = [graph.add("ReduceMax", [graph.add("Abs", [each])], axes=[1], keepdims=1) for each in away]
    return graph.add("Max", [none, *most])


def _side_for(graph: Graph, action: str, side: str, hesitation: str) -> str:
    """The side to turn to, as `Advice.side_for` has it."""
    none, left = graph.constant("none", np.float32(0.0)), graph.constant("left", np.float32(1.0))
    right = graph.add("Less", [graph.column(action, ANGULAR), none])
    own = graph.add("Where", [right, graph.add("Neg", [left]), left])
    return graph.add("Where", [hesitation, own, side])


def _decided(graph: Graph, action: str, gain: ArrayLike, squares: str, side: str) -> str:
    """The action with its turn as `decided` has it."""
    linear, turn = (graph.column(action, k) for k in (0, ANGULAR))
    root = graph.add("Sqrt", [graph.add("Max", [squares, graph.constant("zero", np.float64(0.0))])])
    size = graph.add("Mul", [graph.cast(root), graph.constant("gain", gain)])
    more = graph.add("Add", [graph.add("Abs", [turn]), graph.constant("undecided", np.float32(UNDECIDED))])
    undecided = graph.add("And", [graph.add("Greater", [size, more]), graph.add("Cast", [side], to=TensorProto.BOOL)])
    decided = graph.add("Where", [undecided, graph.add("Mul", [side, size]), turn])
    return graph.add("Concat", [linear, decided], axis=1)
