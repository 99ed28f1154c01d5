"""A vehicle with an arm holds its place and its hand before a wall, in a current that nobody told it.

The vehicle of examples/rov.urdf, of a BlueROV2's size, faces a rigid wall half a metre before it. Eight thrusters drive
it, four level ones at 45° and four upright ones, by up to 40 N each, and three motors the arm. It starts 0.3 m away from
its station and turned by 0.4 rad, comes there, and keeps its place and heading, and its fingertip 0.1 m from the wall. A
current runs along the wall and turns halfway. Vehicle, arm and wall feel each other through the water (`reduced`).

Three controllers, each at 50 Hz, do the same task, by the same measurements of the whole state, which have no noise:

- pid: PIDs of place and attitude, allotted to the thrusters by the pseudo-inverse of `sim.allocation`, cut off at 40 N,
  PIDs of the joints, and a PI of the fingertip by the transpose of the arm's Jacobian. Its gains were tuned on this run;
- mpc: model-predictive control (`hg.optimize.Mpc`) of thrusters and arm at once, with the limits in the plan. Its model
  is in still water, drags less and has a longer time step than the plant;
- mpc, learning: the same, which every half a second fits the current of its model to how the vehicle has moved.

    python examples/rov.py [--seconds S] [--out FILE] [--json] [--quick]
"""

from __future__ import annotations

import argparse
import json
import math
import pathlib
import sys
import tempfile
import time
from dataclasses import dataclass

import numpy as np

import hydrograd as hg
from hydrograd import cost

URDF = pathlib.Path(__file__).parent / "rov.urdf"
# Time steps of plant and model, s; the plant's steps in a piece, after which one learns.
STEP, MODEL_STEP, PIECE = 0.02, 0.1, 10
# The wall's distance from the station, m, and the currents before and after half of the run, m/s.
WALL = 0.6
CURRENTS = (0.0, 0.25, 0.0), (0.0, -0.2, 0.1)
DRAG, MODEL_DRAG = 1.2, 1.0
# Place (m), heading (rad) and posture (shoulder and elbow, rad) of the start; the station is at the origin.
START, HEADING, POSTURE = (-0.25, 0.15, 0.1), 0.4, (0.9, -0.9)
THRUST, TORQUE, LAG = 40.0, 9.0, 0.15  # N, N m, s
# Where thrusters push, m, and whither.
DIAGONAL = math.sqrt(0.5)
THRUSTERS = [((0.156 * x, 0.111 * y, 0.0), (DIAGONAL * x, -DIAGONAL * y, 0.0)) for x in (1, -1) for y in (-1, 1)]
THRUSTERS += [((0.12 * x, 0.218 * y, 0.0), (0.0, 0.0, 1.0)) for x in (1, -1) for y in (-1, 1)]
TIP = np.array([0.06, 0.0, 0.0])  # in the hand's frame, m
# What damps the vehicle beside the drag of its surface: along and about its axes.
LINEAR, QUADRATIC = (4.0, 6.2, 5.2, 0.07, 0.07, 0.07), (9.0, 11.0, 18.0, 1.5, 1.5, 1.5)
REACH = 0.05  # m
# Stiffness, damping and integral gain of the PIDs, for 1 m or 1 rad.
GAINS = (250.0, 160.0, 200.0), (6.0, 3.0, 5.0), (3.0, 0.3, 3.0), (20.0, 0.0, 20.0)
# Weights of the plans, per second; what counts once at a plan's end is END times that.
WEIGHTS = {"place": 300.0, "attitude": 30.0, "hand": 600.0, "speed": 3.0, "posture": 1.0, "thrust": 5e-4, "torque": 5e-3}
END = 1.0
HORIZON = {"knots": 12, "hold": 1, "every": 1, "iterations": 1, "first_iterations": 10}
PROBE = 0.02  # m/s
SETTLED = 2.5  # s: by then it should be there


def scene_of(current, drag):
    """The vehicle before the wall in a current, m/s, with a coefficient of drag."""
    scene = hg.Scene(hg.Fluid(current=current), gravity=(0.0, 0.0, -9.81))
    scene.add_wall((WALL, 0.0, 0.0), (-1.0, 0.0, 0.0))
    scene.add_robot(
        URDF,
        base="free",
        faces=160,
        limits=False,
        drag=hg.Drag(quadratic=drag, quadratic_part="normal"),
        start=dict(zip(("arm_shoulder", "arm_elbow"), POSTURE)),
        motions={"arm_wrist": hg.Motion.linear(0.0)},
        # The arm's base sits in a corner of the vehicle and moves no water of its own.
        links={"arm_base": {"shape": "none", "volume": 1.6965e-4, "center_of_buoyancy": (0.0, 0.0, -0.03)}},
    )
    # What turns with a rotor's speed is the thrust, which lags behind its command; a rotor on the world is that lag alone.
    for i, (at, direction) in enumerate(THRUSTERS):
        rotor = f"rotor {i + 1}"
        scene.add(hg.Body(name=rotor, mass=0.01, inertia=(1e-4, 1e-4, 1e-4), joint=hg.revolute((1.0, 0.0, 0.0))))
        thruster = {"body": "vehicle", "at": at, "direction": direction, "polynomial": (1.0,), "name": f"thruster {i + 1}"}
        scene.add_force("thruster", **thruster, rotor=rotor, time_constant=LAG)
    scene.add_force("damping", body="vehicle", linear=LINEAR, quadratic=QUADRATIC)
    return scene


def simulator(current, step, drag, cache):
    """The scene made ready, with few points a body; their setup is kept in a folder."""
    return hg.Simulator(scene_of(current, drag), step, fidelity="reduced", rank=20, cache=cache)


class Robot:
    """Where things are among the numbers, and where the fingertip belongs."""

    def __init__(self, sim):
        self.sim = sim
        self.hand = sim.body_names.index("hand")
        self.thrusters = sim.thruster_controls("vehicle")
        self.motors = [i for i in range(sim.control_size) if i not in self.thrusters]
        self.joints = [sim.velocity_names.index(sim.control_names[i].replace(".force", "")) for i in self.motors]
        self.limits = np.full(sim.control_size, THRUST)
        self.limits[self.motors] = TORQUE
        self.goal = self.tips(sim.rollout(steps=0))[0]

    def tips(self, rollout):
        """Where the fingertip is, (steps + 1, 3), m."""
        return rollout.positions[:, self.hand] + rollout.rotations[:, self.hand] @ TIP

    def start(self):
        """Away from the station, at rest."""
        q = np.array(self.sim.initial_q)
        q[:3], q[3:7] = START, (math.cos(0.5 * HEADING), 0.0, 0.0, math.sin(0.5 * HEADING))
        return q, np.zeros(self.sim.v_size)


class Loop:
    """One entry of the PIDs: it integrates unless told that something is cut off."""

    def __init__(self, stiffness, damping, integral):
        self.stiffness, self.damping, self.integral = stiffness, damping, integral
        self.error, self.sum = np.zeros(3), np.zeros(3)

    def answer(self, error, rate):
        self.error = error
        return self.stiffness * error - self.damping * rate + self.integral * self.sum

    def integrate(self):
        self.sum = self.sum + STEP * self.error


class Pid:
    """PIDs of place, attitude, joints and fingertip, through the allocation matrix."""

    def __init__(self, robot, gains):
        self.robot = robot
        self.place, self.attitude, self.posture, self.reach = self.loops = [Loop(*g) for g in gains]
        self.allot = np.linalg.pinv(robot.sim.allocation("vehicle"))
        self.applied, self.replans = [], []

    def act(self, seen):
        robot = self.robot
        off = robot.sim.difference(seen.q, robot.sim.initial_q)
        equations = robot.sim.equations(seen.q)
        lever = equations.jacobian("hand", TIP)[:3, robot.joints]
        turn = equations.rotations[0]
        tip = equations.positions[robot.hand] + equations.rotations[robot.hand] @ TIP
        force = self.place.answer(off[:3], seen.v[:3])
        torque = self.attitude.answer(off[3:6], seen.v[3:6])
        # The arm doesn't reach out for a goal that is far away.
        pull = self.reach.answer(np.clip(robot.goal - tip, -REACH, REACH), equations.velocity("hand", seen.v, TIP)[:3])
        wanted = np.empty(robot.sim.control_size)
        wanted[robot.thrusters] = self.allot @ np.concatenate([turn.T @ force, turn.T @ torque])
        wanted[robot.motors] = self.posture.answer(off[robot.joints], seen.v[robot.joints]) + lever.T @ pull
        control = np.clip(wanted, -robot.limits, robot.limits)
        if np.array_equal(control, wanted):  # else the integrals would wind up
            for loop in self.loops:
                loop.integrate()
        self.applied.append(control)
        return control

    def learn(self, rollout, controls):
        """Its integrals do."""


class Predictive:
    """Model-predictive control; with `learning` it fits its model's current to every piece of the run."""

    def __init__(self, robot, model, learning):
        self.robot, self.model, self.learning = robot, model, learning
        self.current = np.zeros(2)  # along the wall: y and z, m/s
        self.learnt = []
        limits = {"lower": -robot.limits, "upper": robot.limits}
        self.mpc = hg.optimize.Mpc(model((0.0, 0.0, 0.0), MODEL_STEP), terms(robot), **HORIZON, **limits)
        self.applied = []

    @property
    def replans(self):
        return self.mpc.replans

    def act(self, seen):
        control = self.mpc.control(seen.time, seen.q, seen.v)
        self.applied.append(control)
        return control

    def learn(self, rollout, controls):
        """A step of Gauss and Newton on the velocities that the model, in a current, foresees from each state to the next."""
        if not self.learning:
            return

        def foreseen(current):
            sim = self.model((0.0, *current), STEP)
            states = [sim.state(q, v) for q, v in zip(rollout.q, rollout.v)]
            return np.concatenate([sim.step(x, u)[0].v[:3] for x, u in zip(states, controls)])

        here = foreseen(self.current)
        slopes = [(foreseen(self.current + d) - here) / PROBE for d in PROBE * np.eye(2)]
        residual = rollout.v[1:, :3].ravel() - here
        change = np.linalg.lstsq(np.array(slopes).T, residual, rcond=None)[0]
        if np.abs(change).max() > 2e-3:
            self.current = np.clip(self.current + change, -0.5, 0.5)
            self.mpc.set_model(self.model((0.0, *self.current), MODEL_STEP))
        self.learnt.append(self.current.tolist())


def terms(robot):
    """What is to be kept low: per second, and once where a plan ends."""
    speeds = np.zeros(robot.sim.v_size)
    speeds[:6] = speeds[robot.joints] = WEIGHTS["speed"]
    rest = np.zeros(robot.sim.v_size)
    rest[robot.joints] = WEIGHTS["posture"]
    efforts = np.where(robot.limits == THRUST, WEIGHTS["thrust"], WEIGHTS["torque"])
    goals = []
    for last, factor in ((False, 1.0), (True, END)):
        goals += [
            cost.position("vehicle", (0.0, 0.0, 0.0), factor * WEIGHTS["place"], last=last),
            cost.orientation("vehicle", (0.0, 0.0, 0.0), factor * WEIGHTS["attitude"], last=last),
            cost.position("fingertip", robot.goal, factor * WEIGHTS["hand"], last=last),
            cost.velocity(0.0 * speeds, factor * speeds, last=last),
        ]
    return [*goals, cost.configuration(robot.sim.initial_q, rest), cost.effort(efforts)]


def run(controller, robot, plants, pieces):
    """The task in pieces, after each of which the controller may learn: its measures, and its history."""
    q, v = robot.start()
    parts = []
    for piece in range(pieces):
        plant = plants[2 * piece // pieces].with_policy(controller)
        rollout = plant.rollout(steps=PIECE, state=plant.state(q, v, step=piece * PIECE))
        controller.learn(rollout, np.array(controller.applied[-PIECE:]))
        q, v = rollout.q[-1], rollout.v[-1]
        parts.append(rollout)

    def joined(of):
        return np.concatenate([of(part)[:PIECE] for part in parts] + [of(parts[-1])[PIECE:]])

    history = {
        "time": STEP * np.arange(pieces * PIECE + 1),
        "off": robot.sim.difference(robot.sim.initial_q, joined(lambda part: part.q)),
        "tip": joined(robot.tips),
        "gap": joined(lambda part: part.min_gap),
        "controls": np.array(controller.applied),
    }
    return measured(controller, robot, history), history


def score(robot, history):
    """What the plans are to keep low, over the whole run and without the terms of speed and posture."""
    off, u = history["off"], history["controls"]
    return STEP * float(
        WEIGHTS["place"] * np.sum(off[:, :3] ** 2)
        + WEIGHTS["attitude"] * np.sum(off[:, 3:6] ** 2)
        + WEIGHTS["hand"] * np.sum((history["tip"] - robot.goal) ** 2)
        + WEIGHTS["thrust"] * np.sum(u[:, robot.thrusters] ** 2)
        + WEIGHTS["torque"] * np.sum(u[:, robot.motors] ** 2)
    )


def measured(controller, robot, history):
    """What a run comes to."""
    t, off, u = history["time"], history["off"], history["controls"]
    errors = {
        "place_mm": 1e3 * np.linalg.norm(off[:, :3], axis=1),
        "heading_deg": np.degrees(np.abs(off[:, 5])),
        "tilt_deg": np.degrees(np.linalg.norm(off[:, 3:5], axis=1)),
        "hand_mm": 1e3 * np.linalg.norm(history["tip"] - robot.goal, axis=1),
    }
    held = t >= SETTLED
    away = np.flatnonzero((t < 0.5 * t[-1]) & ((errors["place_mm"] > 20.0) | (errors["heading_deg"] > 2.0)))
    found = {"cost": score(robot, history), "arrived_s": float(t[away[-1] + 1])}
    for name, error in errors.items():
        found[name] = {"rms": float(np.sqrt(np.mean(error[held] ** 2))), "worst": float(error[held].max())}
    thrusts = np.abs(u[:, robot.thrusters])
    found |= {
        "thrust_rms_N": float(np.sqrt(np.mean(thrusts**2))),
        "thrust_held_rms_N": float(np.sqrt(np.mean(thrusts[held[:-1]] ** 2))),
        "thrust_most_N": float(thrusts.max()),
        "torque_most_Nm": float(np.abs(u[:, robot.motors]).max()),
        "hand_to_wall_least_mm": float(1e3 * (WALL - history["tip"][:, 0].max())),
        "gap_least_mm": float(1e3 * np.nanmin(history["gap"])),
    }
    plans = controller.replans[1:]
    if plans:
        seconds = np.array([plan.seconds for plan in plans])
        found |= {
            "plans": len(plans) + 1,
            "plans_failed": sum(plan.failure is not None for plan in plans),
            "plan_ms": float(1e3 * np.median(seconds)),
            "plan_longest_ms": float(1e3 * seconds.max()),
            "planning_Hz": float(1.0 / np.median(seconds)),
        }
    if getattr(controller, "learnt", None):
        found["currents_learnt"] = controller.learnt
    return found
