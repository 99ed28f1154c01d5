"""A vehicle with an arm holds its place and its hand before a wall, in a current that nobody told it.

The vehicle of examples/rov.urdf, of a BlueROV2's size, faces a rigid wall 0.6 m before its middle. Eight thrusters
drive it, four level ones at 45° and four upright ones, by up to 40 N each, which lags 0.15 s behind the commands; three
motors move the arm. It starts 0.3 m away from its station and turned by 0.4 rad, comes there, and keeps its place and
heading, and its fingertip 0.11 m from the wall. A current runs along the wall, and is another one from the middle of
the run on, all at once. Vehicle, arm and wall feel each other through the water (`reduced`), in the plans too.

Three controllers do it, each at 50 Hz. All are told the whole state, without noise:

- pid: PIDs of place and attitude, allotted to the thrusters by the pseudo-inverse of `sim.allocation` and cut off at
  40 N; PIDs of the joints, and one of the fingertip by the transpose of the arm's Jacobian. Their gains were tuned by
  a search on this very run, for the cost of the plans and for what is off while holding;
- mpc: model-predictive control (`hg.optimize.Mpc`) of thrusters and arm at once, with the limits in the plan. It
  plans 1.2 s ahead, ten times a second, with a model in still water that drags less and makes longer time steps;
- mpc, learning: the same, which every tenth of a second fits the current of its model to how the vehicle has moved.

    python examples/rov.py [--seconds S] [--out FILE] [--json] [--quick]

Measured, on two cores that others used as well, over 12 s: the cost of the whole run is 35.6 with the PIDs, 35.4 with
MPC and 34.2 with MPC that learns, and they are within 2 cm and 2° after 1.7 s, 1.0 s and 0.8 s. From 2.5 s on the
vehicle is off by 2.7 mm, 13.2 mm and 2.2 mm (RMS; at worst 13.9 mm, 16.0 mm and 11.8 mm), the fingertip by 0.3 mm,
4.3 mm and 0.8 mm (1.4 mm, 5.1 mm and 5.6 mm). A model in still water leaves MPC 11 to 16 mm off, much worse than the
PIDs; with the current learnt it is there first and keeps the place best, while the stiff PIDs keep the fingertip, and
roll and pitch, better (0.06° to its 0.11°, RMS). No command exceeds 40 N, and the fingertip comes no nearer to the wall
than 94 mm. A plan takes 43 ms (23 Hz would be possible), at most 78 ms, and the very first some more; to learn takes
15 ms, and 165 ms where new models are made, which is longer than the tenth of a second that a robot has: no time passes
here while controllers think. All steps are momentum Euler's, by which the gains were tuned; it damps. With the default
integrator, as with finer steps, those PIDs chatter (over 5 s: roll and pitch off by 1.2°, RMS, the vehicle by 5.0 mm), and
MPC that learns does as well as before (0.2°, 4.5 mm).
"""

from __future__ import annotations

import argparse
import json
import math
import pathlib
import sys
import tempfile
import time

import numpy as np

import hydrograd as hg
from hydrograd import cost

URDF = pathlib.Path(__file__).parent / "rov.urdf"
# Time steps of plant and model, s; the plant's steps in a piece, after which one learns.
STEP, MODEL_STEP, PIECE = 0.02, 0.05, 5
# The wall's distance from the station, m, the currents before and after half of the run, m/s, and coefficients of drag.
WALL = 0.6
CURRENTS = (0.0, 0.25, 0.0), (0.0, -0.2, 0.1)
DRAG, MODEL_DRAG = 1.2, 1.0
# Place (m), heading (rad) and posture (shoulder and elbow, rad) of the start; the station is at the origin.
START, HEADING, POSTURE = (-0.25, 0.15, 0.1), 0.4, (0.9, -0.9)
THRUST, TORQUE, LAG = 40.0, 9.0, 0.15  # N, N m, s
# kg m². A rotor on the world is a lag whatever its inertia; a large one leaves steps in one piece.
ROTOR = (30.0, 30.0, 30.0)
# Where thrusters push, m, and whither.
DIAGONAL = math.sqrt(0.5)
THRUSTERS = [((0.156 * x, 0.111 * y, 0.0), (DIAGONAL * x, -DIAGONAL * y, 0.0)) for x in (1, -1) for y in (-1, 1)]
THRUSTERS += [((0.12 * x, 0.218 * y, 0.0), (0.0, 0.0, 1.0)) for x in (1, -1) for y in (-1, 1)]
TIP = np.array([0.06, 0.0, 0.0])  # in the hand's frame, m
# What damps the vehicle beside the drag of its surface: along and about its axes.
LINEAR, QUADRATIC = (4.0, 6.2, 5.2, 0.07, 0.07, 0.07), (9.0, 11.0, 18.0, 1.5, 1.5, 1.5)
REACH = 0.05  # m: what the PID of the fingertip sees of an error
# Stiffness, damping and integral gain of the PIDs, for 1 m or 1 rad.
GAINS = (1020.0, 261.0, 1851.0), (110.0, 18.0, 197.0), (0.003, 0.016, 13.0), (370.0, 10.0, 2500.0)
# Weights of the plans, per second; what counts once at a plan's end is END times that.
WEIGHTS = {"place": 300.0, "attitude": 30.0, "hand": 600.0, "speed": 0.3, "posture": 1.0, "thrust": 0.8, "torque": 5e-3}
END = 1.0
HORIZON = {"knots": 24, "every": 2, "iterations": 1, "first_iterations": 10}
# By how much the learner's models differ in their current, and what change of it is worth a new model, m/s.
PROBE, WORTH = 0.02, 2e-3
SETTLED = 2.5  # s: by then it should be there


def scene_of(current, drag):
    """The vehicle before the wall in a current, m/s, with a coefficient of drag; the wrist doesn't turn."""
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
    # Commands are parts of the full thrust, which lags behind them; a rotor on the world is that lag alone.
    for i, (at, direction) in enumerate(THRUSTERS):
        rotor = f"rotor {i + 1}"
        scene.add(hg.Body(name=rotor, mass=1.0, inertia=ROTOR, joint=hg.revolute((1.0, 0.0, 0.0))))
        scene.add_force(
            "thruster",
            body="vehicle",
            at=at,
            direction=direction,
            polynomial=(THRUST,),
            rotor=rotor,
            time_constant=LAG,
            name=f"thruster {i + 1}",
        )
    scene.add_force("damping", body="vehicle", linear=LINEAR, quadratic=QUADRATIC)
    return scene


def simulator(current, step, drag, cache):
    """The scene made ready, with few points a body; their setup is kept in a folder. The PIDs' gains were tuned with this integrator and step."""
    return hg.Simulator(scene_of(current, drag), step, fidelity="reduced", rank=20, cache=cache, integrator="momentum-euler")


class Robot:
    """Where things are among the numbers, and where the fingertip belongs."""

    def __init__(self, sim):
        self.sim = sim
        self.vehicle, self.hand = (sim.body_names.index(name) for name in ("vehicle", "hand"))
        self.thrusters = sim.thruster_controls("vehicle")
        self.motors = [i for i in range(sim.control_size) if i not in self.thrusters]
        self.joints = [sim.v_names.index(sim.control_names[i].replace(".force", "")) for i in self.motors]
        self.limits = np.ones(sim.control_size)
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
        turn = equations.rotations[robot.vehicle]
        tip = equations.positions[robot.hand] + equations.rotations[robot.hand] @ TIP
        force = self.place.answer(off[:3], seen.v[:3])
        torque = self.attitude.answer(off[3:6], seen.v[3:6])
        # The arm doesn't reach out for a goal that is far away.
        pull = self.reach.answer(np.clip(robot.goal - tip, -REACH, REACH), equations.velocity("hand", seen.v, TIP)[:3])
        wanted = np.empty(robot.sim.control_size)
        wanted[robot.thrusters] = self.allot @ np.concatenate([turn.T @ force, turn.T @ torque]) / THRUST
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
        self.model, self.learning = model, learning
        limits = {"lower": -robot.limits, "upper": robot.limits}
        self.mpc = hg.optimize.Mpc(model((0.0, 0.0, 0.0), MODEL_STEP), terms(robot), **HORIZON, **limits)
        self.applied, self.learnt, self.learning_seconds = [], [], []
        self.assume(np.zeros(2))

    @property
    def replans(self):
        return self.mpc.replans

    def act(self, seen):
        control = self.mpc.control(seen.time, seen.q, seen.v)
        self.applied.append(control)
        return control

    def assume(self, current):
        """Takes a current along the wall, y and z, m/s, to be true, and makes models to look beside it."""
        self.current = current
        if self.learning:
            beside = (current, *(current + PROBE * np.eye(2)))
            self.models = [self.model((0.0, *c), STEP) for c in beside]
            self.mpc.set_model(self.model((0.0, *current), MODEL_STEP))

    def learn(self, rollout, controls):
        """A step of Gauss and Newton on the velocities that the model foresees from each state to the next."""
        if not self.learning:
            return
        begun = time.perf_counter()
        here, *beside = (foreseen(model, rollout, controls) for model in self.models)
        slopes = np.stack([(there - here) / PROBE for there in beside], axis=1)
        change = np.linalg.lstsq(slopes, rollout.v[1:, :3].ravel() - here, rcond=None)[0]
        if np.abs(change).max() > WORTH:
            self.assume(np.clip(self.current + change, -0.5, 0.5))
        self.learnt.append(self.current.tolist())
        self.learning_seconds.append(time.perf_counter() - begun)


def foreseen(model, rollout, controls):
    """The vehicle's velocities, m/s, that a model foresees one step after each state of a run."""
    states = [model.state(q, v) for q, v in zip(rollout.q, rollout.v)]
    return np.concatenate([model.step(state, u)[0].v[:3] for state, u in zip(states, controls)])


def terms(robot):
    """What is to be kept low: per second, and once where a plan ends."""
    speeds = np.zeros(robot.sim.v_size)
    speeds[:6] = speeds[robot.joints] = WEIGHTS["speed"]
    rest = np.zeros(robot.sim.v_size)
    rest[robot.joints] = WEIGHTS["posture"]
    efforts = np.full(robot.sim.control_size, WEIGHTS["torque"])
    efforts[robot.thrusters] = WEIGHTS["thrust"]
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
    thrusts = THRUST * np.abs(u[:, robot.thrusters])
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
        half = len(controller.learnt) // 2
        found |= {
            "currents_learnt": [controller.learnt[half - 1], controller.learnt[-1]],
            "learning_ms": float(1e3 * np.median(controller.learning_seconds)),
            "learning_longest_ms": float(1e3 * np.max(controller.learning_seconds)),
        }
    return found


def compare(pieces, cache, say):
    """The task by all three: measures and histories."""
    begun = time.perf_counter()
    plants = [simulator(current, STEP, DRAG, cache) for current in CURRENTS]

    def model(current, step):
        return simulator(current, step, MODEL_DRAG, cache)

    robot = Robot(model((0.0, 0.0, 0.0), STEP))
    say(f"ready after {time.perf_counter() - begun:.1f} s")
    report, histories = {}, {}
    for name, make in {
        "pid": lambda: Pid(robot, GAINS),
        "mpc": lambda: Predictive(robot, model, False),
        "mpc, learning": lambda: Predictive(robot, model, True),
    }.items():
        begun = time.perf_counter()
        report[name], histories[name] = run(make(), robot, plants, pieces)
        report[name]["seconds"] = time.perf_counter() - begun
        say(f"{name}: {report[name]['seconds']:.1f} s")
    return report, histories, robot


def draw(file, histories, robot):
    """How far off they are, and how hard thrusters push."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        print("no picture: matplotlib isn't installed (pip install matplotlib)", file=sys.stderr)
        return
    figure = Figure(figsize=(9, 7), layout="constrained")
    axes = figure.subplots(4, 1, sharex=True)
    for name, history in histories.items():
        t = history["time"]
        curves = (
            1e3 * np.linalg.norm(history["off"][:, :3], axis=1),
            np.degrees(np.abs(history["off"][:, 5])),
            1e3 * np.linalg.norm(history["tip"] - robot.goal, axis=1),
        )
        for axis, curve in zip(axes, curves):
            axis.semilogy(t, np.maximum(curve, 1e-2), lw=1.0, label=name)
        axes[3].plot(t[:-1], THRUST * np.abs(history["controls"][:, robot.thrusters]).max(axis=1), lw=1.0)
    labels = "vehicle off by, mm", "heading off by, °", "fingertip off by, mm", "largest thrust, N"
    for axis, label in zip(axes, labels):
        axis.set_ylabel(label)
        axis.axvline(0.5 * t[-1], color="grey", lw=0.6, ls="--")
    axes[0].legend(fontsize=8)
    axes[3].set_xlabel("t, s")
    figure.savefig(file)
    print(f"wrote {file}", file=sys.stderr)


def tell(report):
    """For people."""
    print(f"from {SETTLED} s on, RMS / worst; the current turns in the middle of the run")
    print(f"{'':40}" + "".join(f"{name:>18}" for name in report))
    rows = {
        "vehicle off by, mm": "place_mm",
        "heading off by, °": "heading_deg",
        "roll and pitch off by, °": "tilt_deg",
        "fingertip off by, mm": "hand_mm",
    }
    for label, key in rows.items():
        cells = (f"{r[key]['rms']:.2f} / {r[key]['worst']:.2f}" for r in report.values())
        print(f"{label:40}" + "".join(f"{cell:>18}" for cell in cells))
    rows = {
        "cost of the whole run": "cost",
        "within 2 cm and 2° after, s": "arrived_s",
        "thrust, RMS of all commands, N": "thrust_rms_N",
        "the same while holding, N": "thrust_held_rms_N",
        "largest thrust commanded, N": "thrust_most_N",
        "largest torque of the arm, N m": "torque_most_Nm",
        "fingertip to the wall, least, mm": "hand_to_wall_least_mm",
        "smallest gap of surfaces, mm": "gap_least_mm",
        "time for a plan, median, ms": "plan_ms",
        "the longest, ms": "plan_longest_ms",
        "plans that could be made a second": "planning_Hz",
        "time to learn, median, ms": "learning_ms",
        "the longest to learn, ms": "learning_longest_ms",
    }
    for label, key in rows.items():
        cells = (f"{r[key]:.2f}" if key in r else "–" for r in report.values())
        print(f"{label:40}" + "".join(f"{cell:>18}" for cell in cells))
    for current, learnt in zip(CURRENTS, report["mpc, learning"]["currents_learnt"]):
        said = ", ".join(f"{c:.3f}" for c in learnt)
        print(f"current along the wall {current[1:]} m/s, learnt with too little drag: ({said})")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seconds", type=float, default=12.0, help="of the run, at least 5; default: %(default)s")
    parser.add_argument("--out", default="rov.png", help="picture; default: %(default)s")
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output")
    parser.add_argument("--quick", action="store_true", help="5 s")
    options = parser.parse_args()
    seconds = 5.0 if options.quick else options.seconds
    if not 5.0 <= seconds < 1e4:
        parser.error(f"--seconds: {seconds:g}; at least 5 are wanted")

    def say(line):
        print(line, file=sys.stderr)

    try:
        with tempfile.TemporaryDirectory() as cache:
            report, histories, robot = compare(round(seconds / (STEP * PIECE)), cache, say)
    except hg.Error as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(1)
    draw(options.out, histories, robot)
    if options.json:
        print(json.dumps(report))
    else:
        tell(report)


if __name__ == "__main__":
    main()
