"""Keras on TensorFlow, with which the thesis trained: the same network and updates, where it is installed."""

import os
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

from lira.fusion.learning.labels import Label

# Read when TensorFlow is loaded; the first one is for its own messages.
SETTINGS = {"TF_CPP_MIN_LOG_LEVEL": "3", "KERAS_BACKEND": "tensorflow", "TF_ENABLE_ONEDNN_OPTS": "1"}
SLOPE = 0.3


def installed() -> bool:
    """Whether there is something to compare with."""
    return find_spec("keras") is not None and find_spec("tensorflow") is not None


class KerasLearner:
    """The fusion network of Appendix B, trained by `train_on_batch` on one thread."""

    def __init__(self, filters: int, labels: list[Label], updates: int, batch: int) -> None:
        for name, value in SETTINGS.items():
            os.environ.setdefault(name, value)
        keras: Any = import_module("keras")
        tensorflow: Any = import_module("tensorflow")
        tensorflow.config.threading.set_intra_op_parallelism_threads(1)
        tensorflow.config.threading.set_inter_op_parallelism_threads(1)
        self._model = _fusion_net(keras, len(labels[0].features.scan), filters)
        self._scans = np.stack([label.features.scan for label in labels])
        self._images = np.stack([label.features.image for label in labels])[..., None]
        self._actions = np.array([label.action for label in labels], np.float32)
        self._random = np.random.default_rng(0)
        self._picks = updates, batch

    def train_step(self) -> None:
        """Run one training step."""
        for pick in self._random.integers(len(self._actions), size=self._picks):
            self._model.train_on_batch([self._scans[pick], self._images[pick]], self._actions[pick])


def _fusion_net(keras: Any, bins: int, filters: int) -> Any:
    """Scan [n, bins] and image [n, 32, 32, 1] -> actions [n, 2]."""
    layers = keras.layers
    scan, image = layers.Input((bins,)), layers.Input((32, 32, 1))
    seen, near = image, scan
    for _ in range(2):
        seen = layers.LeakyReLU(negative_slope=SLOPE)(layers.Conv2D(filters, 3)(seen))
        near = layers.LeakyReLU(negative_slope=SLOPE)(layers.Dense(64)(near))
    both = layers.Concatenate()([layers.Flatten()(layers.MaxPooling2D(2)(seen)), near])
    for _ in range(2):
        both = layers.LeakyReLU(negative_slope=SLOPE)(layers.Dense(128)(both))
    model = keras.Model([scan, image], layers.Dense(2, activation="tanh")(both))
    model.compile(optimizer=keras.optimizers.Adam(1e-3), loss="mse")
    return model
