"""A tendon-driven fish held against tracks from a tank: identified at two speeds of its motor, predicted at the others.

The fish swims freely; nine markers are filmed from above. Its head is rigid, its tail five hinges with springs and a fin; a motor's crank pulls two tendons. Planar, the bodies' own added mass by strips. Five
coefficients are identified from the films at 1.00 and 1.75 Hz (nominal), on exact Jacobians of the rollouts: how far the tail is bent, the drag along the fish (quadratic and linear), the drag across its body,
and how much the waves that its box makes damp its sway, in proportion to the beat's cube. Fixed are the part of Lighthill's trailing-edge force (0.3, or 0.6 with tendons) and the tail's
normal drag (1.6). Two drives:

- angles: the hinges go through what the crank would bend them to in air, all in phase;
- tendons: the crank pulls through the tendons' stiffness against the hinges' springs and the water, which bends the tail.

The tail beats at about three quarters of the motor's nominal speed; the beat is measured from each film. Beside it: the straight line through the two training speeds.

DATA is a folder with `tracks/fA_BB.csv`, as docs/tank.md describes. Without one, tracks are made here, with noise, and the truth is known.

    python examples/fish_tank.py [--data FOLDER] [--drive angles|tendons|both] [--json] [--out FILE] [--quick]
    python examples/fish_tank.py --make FOLDER
"""

import argparse
import csv
import json
import math
import pathlib
import re
import sys
import time

import numpy as np

import hydrograd as hg
import tables

TRAIN = ["f1_00", "f1_75"]
BEAT = 0.75  # beats per turn that the motor is said to make, about
DENSITY = 1000.0
DEG = math.degrees(1.0)

# Along the fish, m, from the middle of its head plate toward the tail.
HINGES = np.array([0.285, 0.3145, 0.3455, 0.376, 0.401])
MARKERS = [-0.077, 0.065, 0.28, 0.2995, 0.3295, 0.3615, 0.3905, 0.4115, 0.474]
CARRIERS = [0, 0, 0, 1, 2, 3, 4, 5, 5]
SPRING = 0.65  # N m/rad
ARMS = np.array([0.0459, 0.0400, 0.0291, 0.0088, -0.0112])  # of a tendon about the hinges, m
CRANK, TENDON = 0.0345, 8000.0  # m; N/m, of both tendons
# Mass (kg), place (m) and inertia (kg m²) of head, crank and segments, from each one's origin.
RIGID = [(1.340673, 0.100994, 0.0147), (0.064812, 0.1655, 1e-4)]
SEGMENTS = [
    (0.01781, 0.017087, 9.2e-6),
    (0.015429, 0.017391, 5.0e-6),
    (0.013048, 0.018007, 2.3e-6),
    (0.010666, 0.015952, 9.3e-7),
    (0.018285, 0.035053, 4.2e-5),
]
# Heights: of the head by place along it, of each segment (its middle, height, height of the gap, length), of the fin by place.
HEAD = [(-0.055, 0.10), (0.065, 0.163), (0.123, 0.10), (0.21, 0.105), (0.278, 0.165), (0.285, 0.18)]
TAIL = [
    (0.0145, 0.10, 0.0725, 0.0295),
    (0.015, 0.095, 0.0675, 0.031),
    (0.016, 0.09, 0.0625, 0.0305),
    (0.0145, 0.085, 0.0575, 0.025),
    (0.0105, 0.08, 0.055, 0.018),
]
FIN, FIN_SPAN, FIN_CHORD, FIN_AT = 0.0075, 0.203, 0.042, 0.053  # m², m, m, its middle from the last hinge, m
EDGE = 0.074  # of the last segment, m
BOX, BODY = 0.07, 0.12  # where the box ends and the body's drag begins, m
SETTLE = 9.0  # s until the swimming is steady


def height(x):
    return next((h for end, h in HEAD if x < end), HEAD[-1][1])


def strips(first, last, count):
    """Middles and width of strips."""
    edges = np.linspace(first, last, count + 1)
    return 0.5 * (edges[1:] + edges[:-1]), edges[1] - edges[0]


def added(parts, surge=0.0):
    """Added mass at unit density (6, 6), of (mass across, place, moment about its middle)."""
    out = np.zeros((6, 6))
    out[0, 0] = surge
    for mass, x, turning in parts:
        out[1, 1] += mass
        out[1, 5] += mass * x
        out[5, 1] += mass * x
        out[5, 5] += mass * x * x + turning
    return (out / DENSITY).tolist()


def plate(h, dx):
    """What a strip of a height carries along, kg."""
    return 0.25 * math.pi * DENSITY * h * h * dx


def scene_of(drive, beat, steps, dt, bend=1.0):
    """The fish at a beat, and the numbers that the unknowns' parameters are of them."""
    scene = hg.Scene(hg.Fluid(density=DENSITY), time_step=dt, steps=steps)
    omega = 2.0 * math.pi * beat
    sets = {"across": {}, "waves": {}}
    x, dx = strips(-0.077, 0.285, 60)
    mass, center, inertia = RIGID[0]
    scene.add(
        hg.Body(
            name="head",
            mass=mass,
            center_of_mass=(center, 0.0, 0.0),
            inertia=(inertia, inertia, inertia),
            added_mass=added([(0.85 * plate(height(at), dx), at, 0.0) for at in x], surge=0.25),
            joint=hg.planar("xy"),
        )
    )
    mass, center, inertia = RIGID[1]
    scene.add(
        hg.Body(
            name="crank", parent="head", mass=mass, center_of_mass=(center, 0.0, 0.0), inertia=(inertia,) * 3, joint=hg.fixed()
        )
    )
    bent = bend * CRANK * ARMS / np.sum(ARMS**2)  # rad, what the crank bends hinges of equal springs to
    for i, ((mass, center, inertia), (middle, tall, gap, length)) in enumerate(zip(SEGMENTS, TAIL)):
        x, dx = strips(0.0, length, 6)
        parts = [(plate(tall if abs(at - middle) <= 0.0075 else gap, dx), at, 0.0) for at in x]
        if i == 4:
            # A fin taller than long: strips go along its chord.
            parts.append((0.87 * 0.25 * math.pi * DENSITY * FIN_CHORD**2 * FIN_SPAN, FIN_AT, 0.87 * math.pi / 128.0 * DENSITY * FIN_CHORD**4 * FIN_SPAN))
        motion = hg.Motion.sine(float(bent[i]), omega) if drive == "angles" else None
        scene.add(
            hg.Body(
                name=f"tail {i + 1}",
                parent=f"tail {i}" if i else "head",
                mass=mass,
                center_of_mass=(center, 0.0, 0.0),
                inertia=(inertia,) * 3,
                added_mass=added(parts),
                joint=hg.revolute((0.0, 0.0, 1.0)),
                position=(HINGES[i] - (HINGES[i - 1] if i else 0.0), 0.0, 0.0),
                motion=[motion] if motion else None,
                passive=None if motion else hg.Passive(stiffness=SPRING),
            )
        )

    def across(body, at, area, coefficient, name):
        scene.add_force(
            "damping", body=body, at=(at, 0.0, 0.0), quadratic=(0.0, 0.5 * DENSITY * coefficient * area, 0.0, 0.0, 0.0, 0.0), name=name
        )

    scene.add_force("damping", body="head", linear=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0), quadratic=(10.0, 0.0, 0.0, 0.0, 0.0, 0.0), name="along")
    x, dx = strips(BODY, 0.285, 8)
    for k, at in enumerate(x):
        across("head", at, height(at) * dx, 8.0, f"body {k + 1}")
        sets["across"][f"body {k + 1}.quadratic.y"] = 0.5 * DENSITY * height(at) * dx
    x, dx = strips(-0.077, BOX, 30)
    moments = [sum(height(at) * dx * at**k for at in x) for k in range(3)]
    waves = np.zeros((6, 6))
    waves[1, 1], waves[1, 5], waves[5, 1], waves[5, 5] = moments[0], moments[1], moments[1], moments[2]
    scene.add_force("damping", body="head", linear=(400.0 * beat**3 * waves).tolist(), name="waves")
    for entry, value in (("y.y", moments[0]), ("y.wz", moments[1]), ("wz.y", moments[1]), ("wz.wz", moments[2])):
        sets["waves"][f"waves.linear.{entry}"] = value
    for i, (middle, tall, gap, length) in enumerate(TAIL):
        x, dx = strips(0.0, length, 2)
        for k, at in enumerate(x):
            across(f"tail {i + 1}", at, (0.5 * tall + 0.5 * gap) * dx, 1.6, f"tail drag {2 * i + k + 1}")
    x, dx = strips(FIN_AT - 0.5 * FIN_CHORD, FIN_AT + 0.5 * FIN_CHORD, 4)
    for k, at in enumerate(x):
        across("tail 5", at, FIN / 4.0, 1.6, f"fin drag {k + 1}")
    scene.add_force(
        "edge",
        body="tail 5",
        at=(EDGE, 0.0, 0.0),
        forward=(-1.0, 0.0, 0.0),
        normal=(0.0, 1.0, 0.0),
        span=FIN_SPAN,
        factor=0.3 if drive == "angles" else 0.6,
        smoothing=0.0,
        name="edge",
    )
    if drive == "tendons":
        arms = {f"tail {i + 1}": float(r) for i, r in enumerate(ARMS)}
        scene.add_force("tendon", arms=arms, stiffness=TENDON, damping=4.0, gain=CRANK, name="tendons")
    for i, (at, carrier) in enumerate(zip(MARKERS, CARRIERS)):
        place = at - (HINGES[carrier - 1] if carrier else 0.0)
        scene.add_site(f"marker {i}", f"tail {carrier}" if carrier else "head", position=(float(place), 0.0, 0.0))
    return scene, sets


class Swim:
    """A simulator of the fish at a beat, what is seen of it, and its controls."""

    def __init__(self, drive, beat, bend=1.0):
        self.drive, self.beat = drive, beat
        self.a_beat = math.ceil(1.0 / (beat * (0.014 if drive == "angles" else 0.005)))  # steps
        beats = max(4, math.ceil(SETTLE * beat)) + 2
        self.steps, self.dt = beats * self.a_beat, 1.0 / (beat * self.a_beat)
        scene, self.sets = scene_of(drive, beat, self.steps, self.dt, bend)
        sim = hg.Simulator(scene, fidelity="isolated", integrator="rk4")
        v = np.array(sim.initial_v)
        v[0] = -max(0.02, 0.19 * beat - 0.06)
        self.sim = sim.with_start(sim.initial_q, v)
        t = self.dt * (np.arange(self.steps) + 0.5)
        self.controls = np.sin(2.0 * math.pi * beat * t)[:, None] if drive == "tendons" else np.zeros((self.steps, 0))
        # The last two beats, some 40 frames each.
        self.seen = np.unique(np.round(np.linspace(self.steps - 2 * self.a_beat, self.steps, 81)).astype(int))
        self.times = self.dt * self.seen

    def features(self, markers):
        """Of markers (n, 9, 2 or 3) at the times seen."""
        return features(self.times, markers[..., :2], self.beat)

    def swim(self, sim):
        """What a simulator of this fish does."""
        rollout = sim.rollout(self.controls) if self.drive == "tendons" else sim.rollout(steps=self.steps)
        return rollout.observe("site_positions")[self.seen]


def basis(t, beat):
    """A constant, drift and three harmonics, (n, 8)."""
    phase = 2.0 * math.pi * beat * t
    columns = [np.ones_like(t), t - t.mean(), *(f(k * phase) for k in (1, 2, 3) for f in (np.cos, np.sin))]
    return np.stack(columns, axis=1)


def harmonics(t, y, beat):
    """Fundamental of a signal by least squares: amplitude and phase as a complex number."""
    c, *_ = np.linalg.lstsq(basis(t, beat), y, rcond=None)
    return complex(c[2], -c[3])


def head_and_tip(p):
    """The head's yaw, rad, and the tip's displacement across its axis, m."""
    head = p[:, 0] - p[:, 1]
    yaw = np.unwrap(np.arctan2(head[:, 1], head[:, 0]))
    side = np.stack([-np.sin(yaw), np.cos(yaw)], axis=1)
    return yaw, np.sum((p[:, 8] - p[:, 0]) * side, axis=1)


def features(t, p, beat):
    """Speed (m/s) as the slope of the way along the head's axis, twice the tip's amplitude and its range across that (m), the head's yaw (rad) and the nose's sway across the mean path (m) as amplitudes, and the phases (rad) of yaw before the
    tip's displacement in the tank."""
    yaw, tip = head_and_tip(p)
    axis = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    way = np.concatenate([[0.0], np.cumsum(np.sum(np.diff(p[:, 1], axis=0) * axis[:-1], axis=1))])
    speed = np.polyfit(t, way, 1)[0]
    mean = np.array([-math.sin(yaw.mean()), math.cos(yaw.mean())])
    turning, lab, nose = (harmonics(t, y, beat) for y in (yaw, p[:, 8] @ mean, p[:, 0] @ mean))
    out = {
        "speed": float(speed),
        "tip": 2.0 * abs(harmonics(t, tip, beat)),
        "yaw": abs(turning),
        "sway": abs(nose),
        "yaw_phase": float(np.angle(turning / lab)),
        "peak_to_peak": float(np.percentile(tip, 98) - np.percentile(tip, 2)),
        "nose_phase": float(np.angle(nose / lab)),
    }
    return out


FEATURES = ("speed", "tip", "yaw", "sway", "yaw_phase")
DEVIATIONS = {"speed": 0.002, "tip": 0.006, "yaw": 0.7 / DEG, "sway": 0.003, "yaw_phase": 6.0 / DEG}


def differences(made, seen):
    """In deviations."""
    off = [made[name] - seen[name] for name in FEATURES]
    off[-1] = math.remainder(off[-1], 2.0 * math.pi)
    return np.array(off) / [DEVIATIONS[name] for name in FEATURES]


def read(path):
    """Times and markers (n, 9, 2)."""
    columns = tables.read(path, ["t", *(f"{axis}{i}" for i in range(9) for axis in "xy")], least=60)
    if np.any(np.diff(columns["t"]) <= 0.0):
        line = int(np.flatnonzero(np.diff(columns["t"]) <= 0.0)[0]) + 3
        raise tables.Wrong(f"{path}: column 't', line {line}: times must ascend")
    markers = np.stack([np.stack([columns[f"x{i}"], columns[f"y{i}"]], axis=1) for i in range(9)], axis=1)
    return columns["t"], markers


def beat_of(file, t, markers, nominal):
    """The tail's beat, Hz: where a fundamental with harmonics leaves least of the tip's motion."""
    _, tip = head_and_tip(markers)

    def left(beat):
        return float(np.linalg.lstsq(basis(t, beat), tip, rcond=None)[1].sum())

    at = BEAT * nominal
    for width in (0.08, 0.01, 0.001):
        tried = at * (1.0 + np.linspace(-width, width, 33))
        k = int(np.argmin([left(f) for f in tried]))
        if width == 0.08 and k in (0, 32):
            raise tables.Wrong(f"{file}: no beat of the tail near {at:.3f} Hz, three quarters of the nominal {nominal} Hz of its name")
        at = float(tried[k])
    return at


def folder(path):
    """Films by name: beat and what was seen."""
    files = sorted((pathlib.Path(path) / "tracks").glob("*.csv"))
    if not files:
        raise tables.Wrong(f"{pathlib.Path(path) / 'tracks'}: no tracks (*.csv)")
    films = {}
    for file in files:
        named = re.fullmatch(r"f(\d+)_(\d+)", file.stem)
        if not named:
            raise tables.Wrong(f"{file}: its name must be fA_BB.csv, with the motor's nominal speed A.BB Hz")
        t, markers = read(file)
        nominal = float(f"{named[1]}.{named[2]}")
        beat = beat_of(file, t, markers, nominal)
        films[file.stem] = {"nominal": nominal, "beat": beat, **features(t, markers, beat)}
    return films


def identify(films, train, drive, say):
    """The coefficients from the training films, and the simulators' bend."""
    if drive == "angles":
        # What the tail does against the head is given by its angles alone.
        bends = [films[name]["tip"] / Swim(drive, films[name]["beat"]).features(rest_tip(1.0, films[name]["beat"], drive))["tip"] for name in train]
        bend = float(np.mean(bends))
    else:
        bend = 1.0
    experiments, sets = [], None
    for name in train:
        swim = Swim(drive, films[name]["beat"], bend)
        keywords = {"controls": swim.controls} if drive == "tendons" else {"steps": swim.steps}
        made = hg.optimize.Experiment(name, swim.sim, **keywords)
        made.saw_function(
            ["site_positions"],
            lambda seen, swim=swim, film=films[name]: differences(swim.features(seen["site_positions"]), film),
            states=swim.seen.tolist(),
        )
        for parameter in swim.sets["waves"]:
            made.scaled(parameter, swim.beat**3)
        experiments.append(made)
        sets = swim.sets
    unknowns = [
        hg.optimize.Unknown(ALONG, sets={"along.quadratic.x": 0.5 * DENSITY}, positive=True, start=0.03, prior=(0.04, 1.0)),
        hg.optimize.Unknown(LINEAR, sets={"along.linear.x": 1.0}, positive=True, start=1.5, prior=(1.5, 1.0)),
        hg.optimize.Unknown(ACROSS, sets=sets["across"], positive=True, start=8.0, prior=(8.0, 1.0)),
        hg.optimize.Unknown(WAVES, sets=sets["waves"], positive=True, start=400.0, prior=(400.0, 1.5)),
    ]
    if drive == "tendons":
        unknowns.append(hg.optimize.Unknown(PULL, sets={"tendons.gain": 1.0}, positive=True, start=CRANK, prior=(CRANK, 0.2)))

    def told(p):
        say(f"{drive}: iteration {p.iteration}: misfit {p.cost:.3f}, {p.simulations} simulations")

    return hg.optimize.identify(experiments, unknowns, progress=told, cost_tolerance=1e-4, profiles=0), bend


def rest_tip(bend, beat, drive):
    """Markers (81, 9, 2) of a fish whose head rests and whose tail goes through its angles."""
    swim = Swim(drive, beat)
    angles = bend * CRANK * ARMS / np.sum(ARMS**2)
    out = np.zeros((len(swim.times), 9, 2))
    for n, t in enumerate(swim.times):
        x, y, turn, frames = 0.0, 0.0, 0.0, [(0.0, 0.0, 0.0)]
        for i in range(5):
            along = HINGES[i] - (HINGES[i - 1] if i else 0.0)
            x, y = x + math.cos(turn) * along, y + math.sin(turn) * along
            turn += angles[i] * math.sin(2.0 * math.pi * beat * t)
            frames.append((x, y, turn))
        for i, (at, carrier) in enumerate(zip(MARKERS, CARRIERS)):
            fx, fy, a = frames[carrier]
            place = at - (HINGES[carrier - 1] if carrier else 0.0)
            out[n, i] = fx + math.cos(a) * place, fy + math.sin(a) * place
    return out


ALONG, LINEAR, ACROSS, WAVES, PULL = "drag along, m²", "linear drag along, N s/m", "drag across", "wave damping, N s⁴/m³", "crank, m"


def parameters_of(values, swim):
    """Parameters of a simulator by the coefficients."""
    out = {"along.quadratic.x": 0.5 * DENSITY * values[ALONG], "along.linear.x": values[LINEAR]}
    out |= {name: part * values[ACROSS] for name, part in swim.sets["across"].items()}
    out |= {name: part * swim.beat**3 * values[WAVES] for name, part in swim.sets["waves"].items()}
    if PULL in values:
        out["tendons.gain"] = values[PULL]
    return out


def predict(films, values, drive, bend):
    """What each film's fish does."""
    out = {}
    for name, film in films.items():
        swim = Swim(drive, film["beat"], bend)
        out[name] = swim.features(swim.swim(swim.sim.with_parameters(parameters_of(values, swim))))
    return out


def line(films, train):
    """Speeds on the straight line through the training films."""
    a, b = (films[name] for name in train[:2])
    slope = (b["speed"] - a["speed"]) / (b["beat"] - a["beat"])
    return {name: a["speed"] + slope * (film["beat"] - a["beat"]) for name, film in films.items()}


def judge(films, made, train):
    """Largest and mean errors on films that weren't trained on."""
    others = [name for name in films if name not in train]
    if not others:
        return None

    def off(key):
        return [abs(made[n][key] - films[n][key]) for n in others]

    return {
        "speed": float(np.mean(off("speed"))),
        "tip": float(np.max([abs(made[n]["peak_to_peak"] / films[n]["peak_to_peak"] - 1.0) for n in others])),
        "yaw": DEG * float(np.max(off("yaw"))),
        "sway": float(np.max(off("sway"))),
        "yaw_phase": DEG * float(np.max([abs(math.remainder(made[n]["yaw_phase"] - films[n]["yaw_phase"], 2.0 * math.pi)) for n in others])),
    }


TRUTH = {ALONG: 0.045, LINEAR: 1.2, ACROSS: 12.0, WAVES: 600.0}
# What was found from the two training films, and the bend: for folders that lack them.
FOUND = {
    "angles": ({ALONG: 0.03704, LINEAR: 1.853, ACROSS: 12.38, WAVES: 826.7}, 0.852),
    "tendons": ({ALONG: 0.0635, LINEAR: 5.084, ACROSS: 18.57, WAVES: 728.9, PULL: 0.02915}, 1.0),
}


def make(path, quick, seed=1):
    """Writes tracks that are made here, with noise."""
    path = pathlib.Path(path)
    (path / "tracks").mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(seed)
    for nominal in (1.0, 1.5, 1.75) if quick else (0.5, 1.0, 1.5, 1.75, 2.0):
        swim = Swim("angles", BEAT * nominal, 0.9)
        markers = swim.sim.with_parameters(parameters_of(TRUTH, swim)).rollout(steps=swim.steps).observe("site_positions")[:, :, :2]
        first = swim.steps - 3 * swim.a_beat
        t = swim.dt * np.arange(swim.steps + 1)
        frames = np.arange(t[first], t[-1], 1.0 / 60.0)
        with open(path / "tracks" / f"f{nominal:.2f}.csv".replace(".", "_", 1), "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["t", *(f"{axis}{i}" for i in range(9) for axis in "xy")])
            for at in frames:
                seen = [np.interp(at, t, markers[:, i, k]) + 2e-4 * random.normal() for i in range(9) for k in range(2)]
                writer.writerow([f"{at - frames[0]:.5f}", *(f"{x:.6f}" for x in seen)])
    return path


def draw(file, films, results):
    """Measured against predicted, over the beat."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        print("no picture: matplotlib isn't installed (pip install matplotlib)", file=sys.stderr)
        return
    order = sorted(films, key=lambda n: films[n]["beat"])
    beats = [films[n]["beat"] for n in order]
    figure = Figure(figsize=(9, 5.5), layout="constrained")
    panels = figure.subplots(2, 3).ravel()
    shown = [("speed", "speed, m/s", 1.0), ("peak_to_peak", "tip, peak to peak, m", 1.0), ("yaw", "yaw, °", DEG), ("sway", "sway of the nose, mm", 1e3), ("yaw_phase", "phase of yaw, °", DEG)]
    for panel, (key, label, unit) in zip(panels, shown):
        panel.plot(beats, [unit * films[n][key] for n in order], "o", color="black", label="measured")
        for (drive, result), style in zip(results.items(), ("-", "--")):
            panel.plot(beats, [unit * result["made"][n][key] for n in order], style, label=drive)
        panel.set(xlabel="beat, Hz", ylabel=label)
    panels[0].legend(fontsize=7)
    panels[5].axis("off")
    figure.savefig(file, metadata={"Date": None} if str(file).endswith(".svg") else None)
    print(f"wrote {file}", file=sys.stderr)


def evaluate(path, train, drives, say, made_here):
    begun = time.perf_counter()
    films = folder(path)
    training = [name for name in train if name in films]
    if len(training) < 2:
        say(f"not both training films are there ({', '.join(train)}): coefficients as found from those of the tank")
        training = []
    straight = line(films, training) if training else None
    others = [n for n in films if n not in train]
    off = [abs(straight[n] - films[n]["speed"]) for n in others] if straight else []
    report = {
        "training": training,
        "unseen": others,
        "measured": films,
        "line": {"speeds": straight, "error": float(np.mean(off)) if off else None},
        "drives": {},
    }
    for drive in drives:
        started = time.perf_counter()
        found, (values, bend) = None, FOUND[drive]
        if training:
            found, bend = identify(films, training, drive, say)
            values = found.values
        identified = time.perf_counter() - started
        made = predict(films, values, drive, bend)
        report["drives"][drive] = {
            "made": made,
            "errors": judge(films, made, train),
            "bend": bend,
            "values": values,
            "coefficients": [
                {
                    "name": u.name,
                    "value": u.value,
                    "standard_error": u.standard_error,
                    "of_prior": u.of_prior,
                    **({"truth": TRUTH[u.name]} if made_here and u.name in TRUTH else {}),
                }
                for u in (found.unknowns if found else [])
            ],
            "simulations": found.simulations if found else 0,
            "jacobians": found.jacobians if found else 0,
            "seconds": identified,
        }
    report["seconds"] = time.perf_counter() - begun
    return report


def tell(report):
    for drive, result in report["drives"].items():
        print(f"{drive}: bend {result['bend']:.3f}; {result['simulations']} simulations, {result['jacobians']} Jacobians, {result['seconds']:.1f} s")
        for c in result["coefficients"]:
            truth = f", true {c['truth']:.4g}" if "truth" in c else ""
            print(f"  {c['name']}: {c['value']:.4g} ± {c['standard_error']:.2g}{truth}")
        print("  measured / predicted   beat Hz   speed m/s   tip, peak to peak mm   yaw °   sway mm   phase of yaw °")
        for name, film in sorted(report["measured"].items(), key=lambda f: f[1]["beat"]):
            made = result["made"][name]
            cells = [
                f"{film['speed']:.4f}/{made['speed']:.4f}",
                f"{1e3 * film['peak_to_peak']:.0f}/{1e3 * made['peak_to_peak']:.0f}",
                f"{DEG * film['yaw']:.1f}/{DEG * made['yaw']:.1f}",
                f"{1e3 * film['sway']:.0f}/{1e3 * made['sway']:.0f}",
                f"{DEG * film['yaw_phase']:.0f}/{DEG * made['yaw_phase']:.0f}",
            ]
            print(f"  {name}{'*' if name in report['training'] else ' '} {film['beat']:.4f}  {'  '.join(cells)}")
        e = result["errors"]
        beside = f" (straight line {report['line']['error']:.4f})" if report["line"]["error"] is not None else ""
        if e:
            print(
                f"  unseen: mean error of the speed {e['speed']:.4f} m/s{beside}; at most {100 * e['tip']:.0f} % of the tip, "
                f"{e['yaw']:.1f} ° of yaw, {1e3 * e['sway']:.0f} mm of sway, {e['yaw_phase']:.0f} ° of phase"
            )
    print(f"{report['seconds']:.1f} s in all")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", type=pathlib.Path, help="folder of tracks; default: tracks made here")
    parser.add_argument("--train", nargs=2, default=TRAIN, metavar="NAME", help="training films (%(default)s)")
    parser.add_argument("--drive", choices=("angles", "tendons", "both"), default="both", help="how the tail is moved (%(default)s)")
    parser.add_argument("--make", type=pathlib.Path, metavar="FOLDER", help="only write tracks made here to a folder")
    parser.add_argument("--quick", action="store_true", help="few tracks, made here")
    parser.add_argument("--out", default="fish_tank.png", help="picture; default: %(default)s")
    parser.add_argument("--json", action="store_true", help="one JSON object on standard output")
    options = parser.parse_args()

    def say(text):
        print(text, file=sys.stderr)

    drives = ("angles", "tendons") if options.drive == "both" else (options.drive,)
    try:
        if options.make:
            make(options.make, options.quick)
            return
        path = options.data
        if path:
            report = evaluate(path, options.train, drives, say, False)
        else:
            import tempfile

            say("no tracks given: made here, with noise")
            with tempfile.TemporaryDirectory() as made:
                report = evaluate(make(made, options.quick), options.train, drives, say, True)
    except (tables.Wrong, hg.Error) as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(1)
    draw(options.out, report["measured"], report["drives"])
    if options.json:
        print(json.dumps(report))
    else:
        tell(report)


if __name__ == "__main__":
    main()
