"""An underwater vehicle with an arm, held against recordings from a tank: identified on some, predicted on the others.

The thrusters are off and the arm moves from one posture to another; the vehicle pitches and rolls. Its attitude is measured by an inertial unit, its joints by encoders. The joints are driven
through what was recorded (C² splines), the run starts in the recorded attitude, rates and velocity, and nothing else is told to the simulation. What isn't known of the vehicle is identified
from the training runs by `hg.optimize.identify`, on exact Jacobians of the rollouts, within what was known beforehand. Three models are scored on all runs, by the root mean
square of roll and pitch against the inertial unit's:

- dynamic: the identified one;
- equilibrium: the attitude at which the same weights and buoyancies would float still at each instant. Most of the answer is there: a dynamic model has to beat it;
- documented: the dynamic one with the constants as they are documented.

DATA is a folder of recordings in the form that docs/tank.md describes: `runs/NAME.csv`, a URDF and its meshes. Without one, recordings are made here, with noise, and the truth is known.

    python examples/uvms.py [--data FOLDER] [--train NAME ...] [--only NAME ...] [--constants FILE]
        [--json] [--out FILE] [--no-coupling] [--quick]
    python examples/uvms.py --make FOLDER
"""

import argparse
import csv
import json
import math
import pathlib
import sys
import time
from dataclasses import dataclass, field

import numpy as np

import hydrograd as hg
import tables

TRAIN = ["004-0", "006-1", "014-1", "030-1", "alt-001-2"]
LIVELY = ["014-1", "020-0", "005-2", "015-1"]
DENSITY, GRAVITY = 997.0, 9.81  # kg/m³, m/s²
STEP = 0.02  # s
# Columns of a recording, of which those in angles are rad, places m, rates rad/s.
JOINTS = ("joint5", "joint4", "joint3", "joint2")  # base to wrist
COLUMNS = ("t", "x", "y", "z", "yaw", "mocap_ok", "imu_roll", "imu_pitch", "gyro_x", "gyro_y", "gyro_z", *JOINTS, "free")
MAY_LACK = ("x", "y", "z", "yaw")  # where motion capture lost the vehicle
DEG = math.degrees(1.0)
ZEROS = ("joint5", "joint4")  # joints whose zero isn't sure
KNOTS = 0.2  # s between points of a joint's motion
VEHICLE = "vehicle_frame"

# What is documented of the setup; kg, L, m, N s²/m² along the link's axes.
LINKS = {
    "r5m_base_link": (0.341, 0.202, (-0.075, -0.006, -0.003), (-0.075, -0.006, -0.003), None),
    "r5m_shoulder_link": (0.194, 0.018, (0.005, -0.001, 0.016), (-0.001, -0.003, 0.032), (0.26, 0.26, 0.3)),
    "r5m_upper_arm_link": (0.429, 0.203, (0.073, 0.0, 0.0), (0.073, 0.0, -0.002), (0.3, 1.6, 1.6)),
    "r5m_forearm_link": (0.115, 0.025, (0.017, -0.026, -0.002), (0.003, 0.001, -0.017), (0.26, 0.3, 0.26)),
    "r5m_wrist_link": (0.333, 0.155, (0.0, 0.0, -0.098), (0.0, 0.0, -0.098), (1.8, 1.8, 0.3)),
}
JAW = (0.05, 0.02, (0.0, 0.0, -0.19))  # in the wrist's frame
# Force in water, N, and place: the counter-weight, two weights, the Doppler log, its bracket, two foams.
ITEMS = [
    (-3.24, (-0.20, 0.165, -0.075)),
    (-1.62, (-0.0975, 0.1275, -0.1325)),
    (-1.62, (-0.0975, -0.1275, -0.1325)),
    (-0.69, (-0.1887, 0.0439, -0.0595)),
    (-1.01, (-0.1542, 0.0439, -0.0795)),
    (8.46, (0.0, 0.11, 0.027)),
    (8.86, (0.0, -0.11, 0.027)),
]
MASS, LIFT, CENTER = 13.17, 13.082, (0.0074, 0.0, 0.02)  # the vehicle: kg, kg of water, m
ADDED = (5.5, 12.7, 14.57)  # kg
LINEAR, QUADRATIC = (4.03, 6.22, 5.18, 0.07, 0.07, 0.07), (18.18, 21.66, 36.99, 1.55, 1.55, 1.55)
INERTIA = (0.45, 0.60, 0.60)  # kg m², the water's included: nobody knows
# What was found from the five training runs: for folders that lack them.
FOUND = {
    f"{VEHICLE}.center_of_buoyancy.x": 0.007544,
    f"{VEHICLE}.center_of_buoyancy.y": 0.000332,
    f"{VEHICLE}.center_of_buoyancy.z": 0.0244,
    "zero of joint5": -0.02623,
    "zero of joint4": 0.02108,
    f"{VEHICLE}.inertia.xx": 0.59,
    f"{VEHICLE}.inertia.yy": 0.5271,
    "water.linear.wx": 0.2222,
    "water.linear.wy": 0.182,
}


def unknowns():
    """What is to be found, with what was known beforehand."""
    place = f"{VEHICLE}.center_of_buoyancy"
    lift = LIFT * GRAVITY  # N
    return [
        # The moment of weight and buoyancy about the vehicle's origin: guesses, to 1 and 2 N m.
        hg.optimize.Unknown(f"{place}.x", prior=(CENTER[0], 1.0 / lift)),
        hg.optimize.Unknown(f"{place}.y", prior=(CENTER[1], 1.0 / lift)),
        hg.optimize.Unknown(f"{place}.z", prior=(CENTER[2], 2.0 / lift)),
        *(
            hg.optimize.Unknown(f"zero of {joint}", sets_start={f"r5m_{joint} zero.angle": 1.0}, prior=(0.0, 0.05))
            for joint in ZEROS
        ),
        hg.optimize.Unknown(f"{VEHICLE}.inertia.xx", prior=(INERTIA[0], 0.2), within=(0.05, 3.0)),
        hg.optimize.Unknown(f"{VEHICLE}.inertia.yy", prior=(INERTIA[1], 0.2), within=(0.05, 3.0)),
        hg.optimize.Unknown("water.linear.wx", prior=(LINEAR[3], 0.2), within=(0.0, 5.0)),
        hg.optimize.Unknown("water.linear.wy", prior=(LINEAR[4], 0.2), within=(0.0, 5.0)),
    ]


@dataclass
class Recording:
    """A run, from its first free sample to its last."""

    name: str
    columns: dict
    free: np.ndarray
    start: dict = field(default_factory=dict)

    @property
    def steps(self):
        return len(self.free) - 1

    def angles(self):
        """Roll and pitch, (steps + 1, 2), rad."""
        return np.column_stack([self.columns["imu_roll"], self.columns["imu_pitch"]])

    def rates(self):
        """Rates about the vehicle's axes x and y, (steps + 1, 2), rad/s."""
        return np.column_stack([self.columns["gyro_x"], self.columns["gyro_y"]])


def read(path):
    """A recording from its file."""
    columns = tables.read(path, COLUMNS, least=2, may_lack=MAY_LACK)
    between = np.diff(columns["t"])
    off = np.flatnonzero(np.abs(between - STEP) > 1e-3)
    if off.size:
        raise tables.Wrong(f"{path}: column 't', line {off[0] + 3}: {between[off[0]]:.4g} s after the line before; samples {STEP} s apart are wanted")
    late = np.flatnonzero(np.abs(columns["t"] - columns["t"][0] - STEP * np.arange(len(columns["t"]))) > 0.5 * STEP)
    if late.size:
        raise tables.Wrong(f"{path}: column 't', line {late[0] + 2}: half a sample off; samples {STEP} s apart throughout are wanted")
    for name in ("imu_roll", "imu_pitch"):
        far = np.flatnonzero(np.abs(columns[name]) > math.pi)
        if far.size:
            raise tables.Wrong(f"{path}: column {name!r}, line {far[0] + 2}: {columns[name][far[0]]} isn't an angle in rad")
    free = columns["free"] > 0.5
    if free.sum() < 100:
        raise tables.Wrong(f"{path}: column 'free': {free.sum()} samples float freely; 100 at least are wanted")
    first, last = np.flatnonzero(free)[[0, -1]]
    columns = {name: values[first : last + 1] for name, values in columns.items()}
    run = Recording(pathlib.Path(path).stem, columns, free[first : last + 1])
    run.start = initial(run)
    return run


def initial(run):
    """Attitude and rates as means over 0.2 s; velocity by a line over 1 s, in the world's axes turned by the heading, which is nobody's business here."""
    c = run.columns
    mean = {name: float(np.mean(c[name][:10])) for name in ("imu_roll", "imu_pitch", "gyro_x", "gyro_y", "gyro_z")}
    seen = (c["mocap_ok"][:51] > 0.5) & np.isfinite(sum(c[name][:51] for name in MAY_LACK))
    velocity = np.zeros(3)
    if seen.sum() > 10:
        t, yaw = c["t"][:51][seen], c["yaw"][:51][seen][0]
        x, y, z = (np.polyfit(t, c[axis][:51][seen], 1)[0] for axis in "xyz")
        velocity = np.array([x * math.cos(yaw) + y * math.sin(yaw), y * math.cos(yaw) - x * math.sin(yaw), z])
    return {
        "attitude": (mean["imu_roll"], mean["imu_pitch"]),
        "rates": np.array([mean["gyro_x"], mean["gyro_y"], mean["gyro_z"]]),
        "velocity": velocity,
    }


def folder(path, only=None):
    """The recordings of a folder, and its URDF."""
    path = pathlib.Path(path)
    files = sorted((path / "runs").glob("*.csv"))
    if only:
        missing = sorted(set(only) - {file.stem for file in files})
        if missing:
            raise tables.Wrong(f"{path / 'runs'}: no recordings {', '.join(missing)}")
        files = [file for file in files if file.stem in only]
    if not files:
        raise tables.Wrong(f"{path / 'runs'}: no recordings (*.csv)")
    urdf = path / "blue_rov_hardware_fixedjaw.urdf"
    if not urdf.is_file():
        raise tables.Wrong(f"{urdf}: no such file; the vehicle's URDF is wanted beside the folder of runs")
    return {file.stem: read(file) for file in files}, urdf


def attitude(roll, pitch):
    """A rotation without heading: matrix, body to world, and quaternion (w, x, y, z)."""
    (sr, cr), (sp, cp) = ((math.sin(a), math.cos(a)) for a in (roll, pitch))
    matrix = np.array([[cp, sp * sr, sp * cr], [0.0, cr, -sr], [-sp, cp * sr, cp * cr]])
    (sr, cr), (sp, cp) = ((math.sin(0.5 * a), math.cos(0.5 * a)) for a in (roll, pitch))
    return matrix, np.array([cr * cp, sr * cp, cr * sp, -sr * sp])


def motion(run, joint):
    """A joint's motion through points that parabolas through 0.4 s of the recording say: its own noise would be acceleration."""
    t, x = run.columns["t"] - run.columns["t"][0], run.columns[joint]
    times = np.linspace(0.0, t[-1], max(2, round(t[-1] / KNOTS) + 1))
    values = []
    for at in times:
        near = np.abs(t - at) < 1.01 * KNOTS
        values.append(np.polynomial.Polynomial.fit(t[near] - at, x[near], min(2, near.sum() - 1))(0.0))
    return hg.Motion.spline(times, values)


def scene_of(run, urdf, box):
    """The vehicle with the joints driven as they were. With `box` the vehicle is the box of its outer sizes, whose water is computed, and feels the arm's."""
    motions = {f"r5m_{name}": motion(run, name) for name in JOINTS}
    scene = hg.Scene(hg.Fluid(density=DENSITY), gravity=(0.0, 0.0, -GRAVITY), time_step=STEP, steps=run.steps)
    added = np.zeros((6, 6))
    added[:3, :3] = np.diag(ADDED) / DENSITY
    vehicle = {
        "mass": MASS,
        "center_of_mass": (0.0, 0.0, 0.0),
        "inertia": INERTIA,
        "volume": LIFT / DENSITY,
        "center_of_buoyancy": CENTER,
    }
    links = {VEHICLE: {**vehicle, **({"shape": "visual"} if box else {"shape": "none", "added_mass": added.tolist()})}}
    for name, (mass, volume, center, buoyancy, _) in LINKS.items():
        links[name] = {
            "mass": mass,
            "center_of_mass": center,
            "volume": volume * 1e-3,
            "center_of_buoyancy": buoyancy,
            "keep": True,
            # What hides behind the box, or nearly touches others, feels nothing of them.
            **({"shape": "none"} if box and name in ("r5m_base_link", "r5m_shoulder_link", "r5m_forearm_link") else {}),
        }
    text = pathlib.Path(urdf).read_text()
    for name in ("vehicle_ballast", "vehicle_cans"):
        if f'link name="{name}"' in text:
            links[name] = {"shape": "none"}
    for name in ("r5m_jaw", "r5m_jaw1", "r5m_jaw2"):  # weighed together, as `JAW`
        if f'link name="{name}"' in text:
            links[name] = {"mass": 1e-9}
    scene.add_robot(
        urdf,
        base="free",
        shape="visual",
        faces=160,
        limits=False,
        actuated=False,
        motions=motions,
        zeros={f"r5m_{joint}": 0.0 for joint in ZEROS},
        links=links,
    )
    for name, (*_, drag) in LINKS.items():
        if drag:
            scene.add_force("damping", body=name, at=LINKS[name][3], quadratic=(*drag, 0.0, 0.0, 0.0), name=f"{name} drag")
    scene.add_force("float", body="r5m_wrist_link", at=JAW[2], volume=JAW[1] * 1e-3, mass=JAW[0], name="jaw")
    for i, (force, at) in enumerate(ITEMS):
        mass, volume = max(-force, 0.0) / GRAVITY, max(force, 0.0) / (DENSITY * GRAVITY)
        scene.add_force("float", body=VEHICLE, at=at, mass=mass, volume=volume, name=f"item {i + 1}")
    scene.add_force("damping", body=VEHICLE, linear=LINEAR, quadratic=QUADRATIC, name="water")
    return scene


def prepare(run, urdf, fidelity="isolated", box=False):
    """A simulator that starts as the recording does; with `box` as there."""
    sim = hg.Simulator(scene_of(run, urdf, box), fidelity=fidelity, integrator="rk4")
    turn, quaternion = attitude(*run.start["attitude"])
    q, v = np.array(sim.initial_q), np.array(sim.initial_v)
    q[:3], q[3:7] = 0.0, quaternion
    v[:3], v[3:6] = run.start["velocity"], turn @ run.start["rates"]
    return sim.with_start(q, v)


# What is seen: how much of a run's samples count as independent, and how far off the model may be, roll and pitch (rad) and rates (rad/s).
INDEPENDENT, OFF, OFF_RATE = 10.0, math.radians(0.25), math.radians(0.5)
EVERY = 5  # of the samples


def experiment(run, sim):
    """What `identify` compares."""
    made = hg.optimize.Experiment(run.name, sim, steps=run.steps)
    states = [n for n in range(0, run.steps + 1, EVERY) if run.free[n]]
    weight = math.sqrt(len(states) / INDEPENDENT)
    for name, seen, deviation, labels in (
        ("attitudes", run.angles(), OFF, ("roll", "pitch")),
        ("gyros", run.rates(), OFF_RATE, ("gyro_x", "gyro_y")),
    ):
        for k, label in enumerate(labels):
            made.saw(name, f"{VEHICLE}.{label}", seen[states, k], states=states, deviation=weight * deviation)
    return made


def identify(runs, sims, say):
    """The unknowns from the training runs."""
    experiments = [experiment(run, sim) for run, sim in zip(runs, sims)]

    def told(p):
        say(f"iteration {p.iteration}: misfit {p.cost:.3f}, {p.simulations} simulations")

    return hg.optimize.identify(experiments, unknowns(), progress=told, cost_tolerance=1e-5)


def with_values(sim, values):
    """A simulator with the constants `values`, by the names of the unknowns."""
    made = sim.with_parameters({name: value for name, value in values.items() if not name.startswith("zero of ")})
    q = np.array(made.initial_q)
    for joint in ZEROS:
        q[made.q_names.index(f"r5m_{joint} zero.angle")] = values[f"zero of {joint}"]
    return made.with_start(q, made.initial_v)


def simulated(sim, run):
    """Roll, pitch (rad) and rates about the vehicle's x and y (rad/s), (steps + 1, 4)."""
    rollout = sim.rollout(steps=run.steps)
    body = sim.scene.index(VEHICLE)
    return np.hstack([rollout.observe("attitudes")[:, body, :2], rollout.observe("gyros")[:, body, :2]]), rollout


def equilibrium(sim, run, rollout):
    """The same where weight and buoyancy balance at each instant: their moment about the vehicle's origin, with it upright and on its side, says where."""
    q = np.array(rollout.q)
    v = np.zeros((len(q), sim.v_size))

    def moment(attitude):
        q[:, 3:7] = attitude
        return -sim.equations(q).bias_force(v)[:, 3:6]

    upright, aside = moment((1.0, 0.0, 0.0, 0.0)), moment((math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0))
    x, y, z = -upright[:, 1], upright[:, 0], -aside[:, 0]
    out = np.column_stack([np.arctan2(y, z), np.arctan2(-x, np.hypot(y, z))])
    rates = np.gradient(out, STEP, axis=0)
    return np.hstack([out, rates * np.column_stack([np.ones(len(out)), np.cos(out[:, 0])])])


def rms(x):
    return float(np.sqrt(np.mean(np.square(x))))


def score(run, made):
    """Root mean squares of what was made less what was measured, °, °/s."""
    off = DEG * (made - np.hstack([run.angles(), run.rates()]))[run.free]
    return dict(zip(("roll", "pitch", "roll_rate", "pitch_rate"), (rms(off[:, k]) for k in range(4))))


def ringing(run, made):
    """Periods of a swing after the arm has stopped, measured and simulated, s; None where there is none to speak of."""
    try:
        from scipy.optimize import least_squares
    except ImportError:
        print("no swings: scipy isn't installed (pip install scipy)", file=sys.stderr)
        return []
    speed = np.max([np.abs(np.gradient(run.columns[j], STEP)) for j in JOINTS], axis=0)
    speed = np.convolve(speed, np.ones(11) / 11.0, "same")
    moving = np.flatnonzero(speed[:-8] > 0.02)
    first = moving[-1] + 5 if moving.size else 0
    if (run.steps - first) * STEP < 4.0:
        return []
    t = STEP * np.arange(run.steps + 1 - first)

    def swing(y):
        def off(p):
            decay = np.exp(-p[1] * t)
            return decay * (p[0] * np.cos(p[2] * t) + p[3] * np.sin(p[2] * t)) + p[4] + p[5] * t - y

        best = None
        for period in np.arange(1.8, 4.0, 0.3):
            start = [0.1, 0.1, 2.0 * math.pi / period, 0.1, float(np.mean(y)), 0.0]
            lower, upper = [-20, 0, 1.2, -20, -90, -1], [20, 2, 4.5, 20, 90, 1]
            found = least_squares(off, np.clip(start, lower, upper), bounds=(lower, upper))
            if best is None or found.cost < best.cost:
                best = found
        p = best.x
        return 2.0 * math.pi / p[2], math.hypot(p[0], p[3]), math.sqrt(2.0 * best.cost / len(t))

    out = []
    for k, name in enumerate(("roll", "pitch")):
        (seen, size, rest), (ours, its, noise) = (swing(DEG * x[first:, k]) for x in (run.angles(), made))
        if size > 0.25 and rest < 0.12 * size and noise < 0.15 * its and its > 0.1:
            out.append({"run": run.name, "angle": name, "measured": seen, "simulated": ours})
    return out


def mean(scores, names, key):
    chosen = [scores[name][key] for name in names if name in scores]
    return float(np.mean(chosen)) if chosen else None


# A vehicle and an arm of our own making, for recordings of our own: the links' names and places, and boxes and cylinders.
URDF = """<?xml version="1.0"?>
<robot name="made">
  <link name="vehicle_frame"><visual><geometry><box size="0.46 0.34 0.25"/></geometry></visual>
    <inertial><mass value="13"/><inertia ixx="0.3" ixy="0" ixz="0" iyy="0.4" iyz="0" izz="0.4"/></inertial></link>
{links}
</robot>
"""
LINK = """  <link name="{name}"><visual><origin xyz="{center}" rpy="{turn}"/><geometry><cylinder radius="0.02" length="{length}"/></geometry></visual>
    <inertial><mass value="{mass}"/><origin xyz="{center}"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial></link>
  <joint name="{joint}" type="{kind}"><parent link="{parent}"/><child link="{name}"/><origin xyz="{at}" rpy="{rpy}"/><axis xyz="0 0 1"/>
    <limit lower="-7" upper="7" effort="9" velocity="1"/></joint>"""
CHAIN = [
    ("arm_to_vehicle", "fixed", VEHICLE, "0.25 -0.11 0.005", "0 0 0", 0.14, "0 1.5708 0"),
    ("r5m_joint5", "revolute", "r5m_base_link", "0 0 0", "0 0 0", 0.05, "0 0 0"),
    ("r5m_joint4", "revolute", "r5m_shoulder_link", "0.02 0 0.046", "1.5708 1.3 0", 0.14, "0 1.5708 0"),
    ("r5m_joint3", "revolute", "r5m_upper_arm_link", "0.15 0 0", "3.1416 0 1.3", 0.04, "1.5708 0 0"),
    ("r5m_joint2", "revolute", "r5m_forearm_link", "0.02 0 0", "-1.5708 0 0", 0.16, "0 0 0"),
]
TRUTH = {  # in the order of the unknowns
    f"{VEHICLE}.center_of_buoyancy.x": 0.0045,
    f"{VEHICLE}.center_of_buoyancy.y": -0.004,
    f"{VEHICLE}.center_of_buoyancy.z": 0.027,
    "zero of joint5": 0.05,
    "zero of joint4": -0.03,
    f"{VEHICLE}.inertia.xx": 0.55,
    f"{VEHICLE}.inertia.yy": 0.75,
    "water.linear.wx": 0.3,
    "water.linear.wy": 0.45,
}


def make(path, names, seconds, seed=1):
    """Writes recordings that are made here, with noise."""
    path = pathlib.Path(path)
    (path / "runs").mkdir(parents=True, exist_ok=True)
    links = []
    for (name, (mass, _, center, _, _)), (joint, kind, parent, at, rpy, length, turn) in zip(LINKS.items(), CHAIN):
        center = " ".join(map(str, center))
        links.append(LINK.format(**locals()))
    urdf = path / "blue_rov_hardware_fixedjaw.urdf"
    urdf.write_text(URDF.format(links="\n".join(links)))
    random = np.random.default_rng(seed)
    home, steps = np.array([1.2, 0.4, 0.6, -1.0]), round(seconds / STEP)
    t = STEP * np.arange(steps + 1)
    for name in names:
        goal = home + random.uniform(-1.2, 1.2, 4)
        s = np.clip((t - 1.0) / (0.55 * seconds), 0.0, 1.0)
        joints = home + np.outer(s**3 * (10.0 - 15.0 * s + 6.0 * s**2), goal - home)
        columns = {name: np.zeros(steps + 1) for name in COLUMNS}
        columns |= {"t": t, "free": np.ones(steps + 1), "mocap_ok": np.ones(steps + 1)}
        columns |= {name: joints[:, k] for k, name in enumerate(JOINTS)}
        run = Recording(name, columns, np.ones(steps + 1, dtype=bool))
        run.start = initial(run)
        # From where it floats still.
        sim = truth_of(prepare(run, urdf))
        still = equilibrium(sim, run, sim.rollout(steps=run.steps))[0]
        run.start["attitude"] = tuple(still[:2])
        made, _ = simulated(truth_of(prepare(run, urdf)), run)
        noise = random.normal(size=(steps + 1, 8))
        for k, name_of in enumerate(("imu_roll", "imu_pitch", "gyro_x", "gyro_y")):
            columns[name_of] = made[:, k] + (3e-4 if k < 2 else 3e-3) * noise[:, k]
        for k, joint in enumerate(JOINTS):
            columns[joint] = joints[:, k] + 1e-4 * noise[:, 4 + k]
        with open(path / "runs" / f"{name}.csv", "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(columns)
            writer.writerows(zip(*(np.round(values, 6) for values in columns.values())))
    return path


def truth_of(sim):
    """A simulator with the constants that recordings of our own are made with."""
    return with_values(sim, TRUTH)


def coupling(run, urdf, values):
    """How much the attitude changes, °, where the vehicle is a box that feels the arm through the water, and where it is the same box without that."""
    made = [
        simulated(with_values(prepare(run, urdf, fidelity, box=True), values), run)[0] for fidelity in ("isolated", "reduced")
    ]
    return {"roll": DEG * rms(made[0][:, 0] - made[1][:, 0]), "pitch": DEG * rms(made[0][:, 1] - made[1][:, 1])}


def draw(file, runs, models):
    """Measured against predicted."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        print("no picture: matplotlib isn't installed (pip install matplotlib)", file=sys.stderr)
        return
    chosen = list(models)[:6]
    figure = Figure(figsize=(9, 2.0 * len(chosen)), layout="constrained")
    axes = figure.subplots(len(chosen), 2, squeeze=False)
    for row, name in zip(axes, chosen):
        run = runs[name]
        t = run.columns["t"] - run.columns["t"][0]
        for k, (panel, angle) in enumerate(zip(row, ("roll", "pitch"))):
            panel.plot(t[::5], DEG * run.angles()[::5, k], color="black", lw=1.2, label="measured")
            panel.plot(t[::5], DEG * models[name]["dynamic"][::5, k], color="tab:red", lw=1.0, label="dynamic")
            panel.plot(t[::5], DEG * models[name]["equilibrium"][::5, k], color="tab:blue", lw=0.8, ls="--", label="equilibrium")
            panel.set_ylabel(f"{name}: {angle}, °")
    axes[0, 0].legend(fontsize=7)
    for panel in axes[-1]:
        panel.set_xlabel("t, s")
    figure.savefig(file, metadata={"Date": None} if str(file).endswith(".svg") else None)
    print(f"wrote {file}", file=sys.stderr)


def evaluate(path, train, only, given, with_coupling, say, made_here):
    """Everything, of one folder."""
    begun = time.perf_counter()
    runs, urdf = folder(path, only)
    training = [] if given else [name for name in train if name in runs]
    known = given["training"] if given else train
    others = [name for name in runs if name not in known and not name.startswith("baseline")]
    if not training and not others:
        raise tables.Wrong(f"{pathlib.Path(path) / 'runs'}: nothing to predict: baselines and training runs alone")
    if training and len(training) < len(train):
        say(f"training runs that aren't there: {', '.join(name for name in train if name not in runs)}")
    sims = {name: prepare(runs[name], urdf) for name in [*training, *others]}
    say(f"{len(sims)} simulators in {time.perf_counter() - begun:.1f} s")
    found, values = None, given["constants"] if given else FOUND
    if training:
        found = identify([runs[n] for n in training], [sims[n] for n in training], say)
        values = found.values
    else:
        say("constants as given" if given else f"none of the training runs is there ({', '.join(train)}): constants as found from the five of the tank")
    identified = time.perf_counter()
    models, scores, swings = {}, {}, []
    for name, sim in sims.items():
        run = runs[name]
        own = with_values(sim, values)
        dynamic, rollout = simulated(own, run)
        still = equilibrium(own, run, rollout)
        documented, _ = simulated(sim, run)
        models[name] = {"dynamic": dynamic, "equilibrium": still, "documented": documented}
        scores[name] = {model: score(run, made) for model, made in models[name].items()}
        swings += ringing(run, dynamic)
    report = {"training": training, "unseen": others, "constants": values}
    for model in ("dynamic", "equilibrium", "documented"):
        own = {name: s[model] for name, s in scores.items()}
        report[model] = {
            "training": {key: mean(own, training, key) for key in ("roll", "pitch")},
            "unseen": {key: mean(own, others, key) for key in ("roll", "pitch")},
            "worst": {key: max((own[n][key] for n in others), default=None) for key in ("roll", "pitch")},
            "lively_rates": {key: mean(own, LIVELY, key) for key in ("roll_rate", "pitch_rate")},
            "runs": own,
        }
    report["unknowns"] = [
        {
            "name": u.name,
            "value": u.value,
            "standard_error": u.standard_error,
            "of_prior": u.of_prior,
            "start": u.start,
            **({"truth": TRUTH[u.name]} if made_here else {}),
        }
        for u in (found.unknowns if found else [])
    ]
    report["swings"] = swings
    report["swing_error"] = max((abs(s["simulated"] / s["measured"] - 1.0) for s in swings), default=None)
    report["floor"] = {"attitude_noise": 0.015, "same_posture": 0.22}  # °: within 1.5 s, and between runs
    if found:
        report["identification"] = {
            "cost": found.cost,
            "iterations": found.iterations,
            "simulations": found.simulations,
            "jacobians": found.jacobians,
            "stop": found.stop,
            "weakest": dict(zip((u.name for u in found.unknowns), found.weak[0].change)) if found.weak else None,
            "seconds": identified - begun,
        }
    if with_coupling:
        for name in [*others, *training]:
            try:
                report["coupling"] = {"run": name, **coupling(runs[name], urdf, values)}
                break
            except hg.Error as error:
                say(f"coupling in {name}: {error}")
    report["seconds"] = time.perf_counter() - begun
    return report, runs, models


def tell(report):
    """For people."""
    print(f"{'run':12} {'dynamic':>15} {'equilibrium':>15} {'documented':>15}   roll / pitch, °")
    for name in [*report["training"], *report["unseen"]]:
        cells = []
        for model in ("dynamic", "equilibrium", "documented"):
            own = report[model]["runs"][name]
            cells.append(f"{own['roll']:6.2f} / {own['pitch']:5.2f}")
        print(f"{name:12} {'  '.join(f'{c:>15}' for c in cells)}" + ("   (training)" if name in report["training"] else ""))
    for part in ("training", "unseen", "worst"):
        if report["dynamic"][part]["roll"] is None:
            continue
        cells = [f"{report[m][part]['roll']:6.3f} / {report[m][part]['pitch']:5.3f}" for m in ("dynamic", "equilibrium", "documented")]
        print(f"{part:12} {'  '.join(f'{c:>15}' for c in cells)}")
    for u in report["unknowns"]:
        truth = f", true {u['truth']:.4g}" if "truth" in u else ""
        if u["standard_error"] == 0.0:
            print(f"{u['name']}: {u['value']:.4g}, at its bound{truth}")
            continue
        of = f", {100 * u['of_prior']:.0f} % of what was known before" if u["of_prior"] is not None else ""
        print(f"{u['name']}: {u['value']:.4g} ± {u['standard_error']:.2g} (start {u['start']:.4g}{of}){truth}")
    rates = [report[m]["lively_rates"] for m in ("dynamic", "equilibrium")]
    if rates[0]["roll_rate"] is not None:
        print("rates of lively runs, °/s, dynamic and equilibrium: " + ", ".join(f"{r['roll_rate']:.3f} / {r['pitch_rate']:.3f}" for r in rates))
    for s in report["swings"]:
        print(f"swing of {s['run']}, {s['angle']}: {s['measured']:.3f} s measured, {s['simulated']:.3f} s simulated")
    floor = report["floor"]
    print(f"floor of the measurement: {floor['attitude_noise']} ° of noise; the same posture scatters by {floor['same_posture']} ° between runs")
    d, e = report["dynamic"]["unseen"], report["equilibrium"]["unseen"]
    if d["roll"] is not None and (d["roll"] >= e["roll"] or d["pitch"] >= e["pitch"]):
        print("the dynamic model does NOT beat the equilibrium in both angles")
    if "coupling" in report:
        c = report["coupling"]
        print(
            f"what arm and vehicle do to each other through the water changes {c['run']} by {c['roll']:.3f} / {c['pitch']:.3f} ° (RMS): "
            "below what can be measured (0.2 ° between runs). The vehicle is a box there, and the arm its upper arm and wrist"
            if max(c["roll"], c["pitch"]) < 0.2
            else f"coupling changes {c['run']} by {c['roll']:.3f} / {c['pitch']:.3f} ° (RMS)"
        )
    if i := report.get("identification"):
        print(f"{i['simulations']} simulations, {i['jacobians']} Jacobians, {i['seconds']:.1f} s to identify")
    print(f"{report['seconds']:.1f} s in all")


def constants(path):
    """Of an earlier run's JSON."""
    try:
        made = json.loads(path.read_text())
        values = {name: float(made["constants"][name]) for name in FOUND}
        return {"constants": values, "training": [str(name) for name in made["training"]]}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise tables.Wrong(f"{path}: not what --json writes: {error!r}") from None


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", type=pathlib.Path, help="folder of recordings; default: recordings made here")
    parser.add_argument("--train", nargs="+", default=TRAIN, metavar="NAME", help="training runs (%(default)s)")
    parser.add_argument("--constants", type=pathlib.Path, metavar="FILE", help="take them from an earlier --json instead of identifying them")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="read these runs alone")
    parser.add_argument("--make", type=pathlib.Path, metavar="FOLDER", help="only write recordings made here to a folder")
    parser.add_argument("--no-coupling", action="store_true", help="don't say what the coupling of arm and vehicle changes")
    parser.add_argument("--quick", action="store_true", help="short recordings, where they are made here")
    parser.add_argument("--out", default="uvms.png", help="picture; default: %(default)s")
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output")
    options = parser.parse_args()

    def say(line):
        print(line, file=sys.stderr)

    names = [*TRAIN[: 3 if options.quick else 5], "made-1", "made-2"]
    seconds = 10.0 if options.quick else 20.0
    try:
        if options.make:
            make(options.make, names, seconds)
            return
        given = constants(options.constants) if options.constants else None
        with_coupling = not (options.no_coupling or options.quick or options.only)
        path = options.data
        if path:
            report, runs, models = evaluate(path, options.train, options.only, given, with_coupling, say, False)
        else:
            import tempfile

            say("no recordings given: made here, with noise")
            with tempfile.TemporaryDirectory() as made:
                folder_made = make(made, names, seconds)
                report, runs, models = evaluate(folder_made, options.train, options.only, given, with_coupling, say, True)
    except (tables.Wrong, hg.Error) as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(1)
    draw(options.out, runs, {n: models[n] for n in [*report["unseen"], *report["training"]]})
    if options.json:
        print(json.dumps(report))
    else:
        tell(report)


if __name__ == "__main__":
    main()
