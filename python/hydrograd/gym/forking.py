"""Forked processes, in which simulations would wait for ever for threads that the fork left behind."""

from __future__ import annotations

import os
import threading

import hydrograd as hg

# How long a step of a single sphere may take before its threads are taken to be missing, s.
_PATIENCE = 10.0

_unsure = False


def _forked() -> None:
    global _unsure
    _unsure = True


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forked)


def ensure_threads() -> None:
    """Raises `UnsupportedError` in a process that was forked from one in which simulations had run."""
    global _unsure
    if not _unsure:
        return
    # Whether threads are missing shows in nothing but the waiting for them: a thread that can be left behind tries it.
    done = threading.Event()

    def simulate() -> None:
        scene = hg.Scene()
        scene.add(hg.Body(hg.sphere(1.0, faces=80), density=998.0))
        hg.Simulator(scene, fidelity="isolated").rollout(steps=1)
        done.set()

    threading.Thread(target=simulate, daemon=True).start()
    if not done.wait(_PATIENCE):
        raise hg.UnsupportedError(
            "this process was forked from one in which simulations had run, and threads don't survive a fork; start it "
            "with spawn: gymnasium.make_vec(…, vectorization_mode='async', vector_kwargs={'context': 'spawn'}), or "
            "step over threads with vectorization_mode='vector_entry_point'"
        )
    _unsure = False
