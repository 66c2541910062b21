"""Networks of the sizes that the robots' profiles have, in few words, and something for them to see."""

from dataclasses import replace

import numpy as np

from lira.fusion.inference.kernel_net import KernelNet
from lira.fusion.policies.networks import ExpertNet, FusionNet
from lira.fusion.preprocess import Features


def shapes(bins, px=32):
    return {"image": (px, px), "scan": (bins,)}


def camera_net(filters, *, px=32, seed=0):
    return ExpertNet("image", (px, px), filters, seed=seed)


def lidar_net(bins, *, seed=0):
    return ExpertNet("scan", (bins,), seed=seed)


def fusion_net(bins, filters, *, px=32, seed=0):
    return FusionNet(shapes(bins, px), filters, seed=seed)


def kernel_net(bins, filters, *, px=32, seed=0, cruises=None):
    """A novice of plus that was taught nothing."""
    return KernelNet.from_experts([camera_net(filters, px=px, seed=seed), lidar_net(bins, seed=seed)], cruises)


def before(network, *, halves=False):
    """A novice of plus as its file says that was written, and proven, before it asked its first expert, or halves."""
    weights = {name: array for name, array in network.weights().items() if name != "others"}
    return KernelNet(replace(network.architecture, asks=False, halves=halves), weights)


def noise(bins, seed=0):
    """What nobody has seen: every value of an image a multiple of 1/255."""
    rng = np.random.default_rng(seed)
    gray = (rng.integers(0, 256, (32, 32)) / 255).astype(np.float32)
    return Features(image=gray, scan=rng.random(bins, dtype=np.float32))
