"""autograd, jax and torch in little, with the names that the package uses: forward derivatives.

They stand in where the libraries themselves are not installed.
"""

import contextlib
import importlib.util
import sys
import types

import numpy as np


class Tensor:
    """(n, ...) numbers, each with its derivatives (n, ..., d) by its own row of x."""

    def __init__(self, data, slopes):
        self.data, self.slopes = data, slopes
        self.shape = data.shape

    @classmethod
    def variable(cls, x):
        return cls(x, np.broadcast_to(np.eye(x.shape[1]), (*x.shape, x.shape[1])))

    def __getitem__(self, at):
        return Tensor(self.data[at], self.slopes[at])

    def __add__(self, other):
        if isinstance(other, Tensor):
            return Tensor(self.data + other.data, self.slopes + other.slopes)
        return Tensor(self.data + other, self.slopes)

    def __sub__(self, other):
        return self + (-other)

    def __neg__(self):
        return Tensor(-self.data, -self.slopes)

    def __pow__(self, n):
        return Tensor(self.data**n, n * self.data[..., None] ** (n - 1) * self.slopes)

    def pull_back(self, weights):
        return np.einsum("nm,nmd->nd", np.asarray(weights), self.slopes)

    def detach(self):
        return self

    def numpy(self):
        return self.data


class Numbers(np.ndarray):
    """What torch's gradients are, as far as they are used."""

    def numpy(self):
        return np.asarray(self)


def fake_autograd():
    def make_vjp(f):
        def at(x):
            value = f(Tensor.variable(x))
            return value.pull_back, value

        return at

    return {"autograd": types.SimpleNamespace(make_vjp=make_vjp)}


def fake_jax():
    def vjp(f, x):
        value = f(Tensor.variable(x))
        return value, lambda weights: (value.pull_back(weights),)

    jax = types.ModuleType("jax")
    jax.vjp, jax.jit, jax.numpy = vjp, lambda f: f, np
    jax.experimental = types.ModuleType("jax.experimental")
    jax.experimental.enable_x64 = lambda on: contextlib.nullcontext()
    return {"jax": jax, "jax.experimental": jax.experimental}


def fake_torch():
    def tensor(x, requires_grad=False):
        return Tensor.variable(x) if requires_grad or x.ndim == 2 else x

    def grad(value, x, weights, retain_graph, allow_unused):
        assert retain_graph and allow_unused
        return (value.pull_back(weights.data).view(Numbers),)

    autograd = types.SimpleNamespace(grad=grad)
    enable_grad = contextlib.nullcontext
    return {
        "torch": types.SimpleNamespace(tensor=tensor, enable_grad=enable_grad, autograd=autograd)
    }


def provide(library, monkeypatch):
    """Has the library, or what stands in for it, ready to be imported."""
    if importlib.util.find_spec(library) is None:
        for name, module in globals()[f"fake_{library}"]().items():
            monkeypatch.setitem(sys.modules, name, module)
