"""torch and JAX with one face, for tests that run on both."""

import numpy as np
import pytest


class Torch:
    """What tests ask of torch."""

    precision = r"torch\.float32; .*\.double\(\)"

    def __init__(self):
        self.torch = pytest.importorskip("torch")
        self.bridge = pytest.importorskip("hydrograd.torch")

    def array(self, values):
        """float64."""
        return self.torch.tensor(np.asarray(values), dtype=self.torch.float64)

    def single(self, values):
        """float32."""
        return self.torch.tensor(np.asarray(values), dtype=self.torch.float32)

    def whole(self, values):
        """int64."""
        return self.torch.tensor(values, dtype=self.torch.int64)

    def numbers(self, array):
        """As NumPy."""
        return array.detach().numpy()

    def compiled(self, function):
        """The function as it is run many times."""

        def run(*given):
            with self.torch.no_grad():
                return function(*given)

        return run

    def differentiate(self, function, *given):
        """Of (cost, arrays) = function(…): the arrays, and the cost's gradient in each of what is given."""
        leaves = [self.array(x).requires_grad_() for x in given]
        cost, made = function(*leaves)
        gradient = self.torch.autograd.grad(cost, leaves)
        return [self.numbers(x) for x in made], [self.numbers(x) for x in gradient]

    def gradcheck(self, function, *given, eps):
        """The framework's own check, which moves single entries: one step fits all."""
        del eps
        leaves = tuple(self.array(x).requires_grad_() for x in given)
        assert self.torch.autograd.gradcheck(function, leaves, eps=1e-6, atol=1e-7, rtol=1e-5)

    fails = (RuntimeError, "Jacobian mismatch")


class Jax:
    """What tests ask of JAX."""

    precision = r"float32; .*astype"

    def __init__(self):
        self.jax = pytest.importorskip("jax")
        self.jax.config.update("jax_enable_x64", True)
        self.bridge = pytest.importorskip("hydrograd.jax")
        self.check_grads = pytest.importorskip("jax.test_util").check_grads

    def array(self, values):
        """float64."""
        return self.jax.numpy.asarray(np.asarray(values, dtype=np.float64))

    def single(self, values):
        """float32."""
        return self.jax.numpy.asarray(np.asarray(values, dtype=np.float32))

    def whole(self, values):
        """int64."""
        return self.jax.numpy.asarray(values, dtype=np.int64)

    def numbers(self, array):
        """As NumPy."""
        return np.asarray(array)

    def compiled(self, function):
        """The function as it is run many times."""
        return self.jax.jit(function)

    def differentiate(self, function, *given):
        """Of (cost, arrays) = function(…): the arrays, and the cost's gradient in each of what is given."""
        places = tuple(range(len(given)))
        whole = self.jax.value_and_grad(function, argnums=places, has_aux=True)
        (_, made), gradient = whole(*map(self.array, given))
        return [self.numbers(x) for x in made], [self.numbers(x) for x in gradient]

    def gradcheck(self, function, *given, eps):
        """The framework's own check, along random directions with the step `eps`."""
        leaves = tuple(map(self.array, given))
        self.check_grads(self.jax.jit(function), leaves, order=1, modes=["rev"], eps=eps, rtol=1e-6)

    fails = (AssertionError, None)


MADE = {"torch": Torch, "jax": Jax}
