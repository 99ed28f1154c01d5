// Arrows: forces at contacts, the water's velocity, and its forces on bodies.
"use strict";

/** Room for `most` of the same shape, which bodies don't hide if it is `on_top`. */
hydrograd.instances = (world, most, geometry, { color, on_top }) => {
  const material = new THREE.MeshBasicMaterial({ color, depthTest: !on_top, transparent: on_top });
  const mesh = new THREE.InstancedMesh(geometry, material, Math.max(most, 1));
  mesh.count = 0;
  mesh.frustumCulled = false;
  mesh.renderOrder = on_top ? 2 : 0;
  world.add(mesh);
  return mesh;
};

hydrograd.Arrows = class {
  /** Room for `most` arrows of a thickness (m). Those `on_top` aren't hidden by bodies. */
  constructor(world, most, { thickness, color, on_top, dots }) {
    const make = (geometry) => hydrograd.instances(world, most, geometry, { color, on_top });
    this.thickness = thickness;
    // Along y from 0 to 1, as three.js makes them.
    this.shafts = make(new THREE.CylinderGeometry(0.5, 0.5, 1, 8).translate(0, 0.5, 0));
    this.heads = make(new THREE.ConeGeometry(1.4, 3.6, 12).translate(0, 1.8, 0));
    this.dots = dots ? make(new THREE.SphereGeometry(1.1, 12, 8)) : null;
    if (this.dots) this.dots.material.color.set(dots);
  }

  /** Shows arrows from points along vectors, both (count, 3) from an offset on, as long (m) as `length` makes of a strength. */
  show(points, vectors, count, { length, points_from = 0, vectors_from = 0 }) {
    const [from, along, up] = [new THREE.Vector3(), new THREE.Vector3(), new THREE.Vector3(0, 1, 0)];
    const [turn, matrix, size] = [new THREE.Quaternion(), new THREE.Matrix4(), new THREE.Vector3()];
    const still = new THREE.Quaternion();
    let drawn = 0;
    for (let i = 0; i < count; i++) {
      from.fromArray(points, points_from + 3 * i);
      if (this.dots) this.dots.setMatrixAt(i, matrix.compose(from, still, size.setScalar(this.thickness)));
      along.fromArray(vectors, vectors_from + 3 * i);
      const strength = along.length();
      const long = length(strength);
      if (!(long > 0)) continue;
      turn.setFromUnitVectors(up, along.divideScalar(strength));
      // Short arrows are thinner, so that the head is never longer than half of one.
      const thick = Math.min(this.thickness, long / 7.2);
      const shaft = long - 3.6 * thick;
      this.shafts.setMatrixAt(drawn, matrix.compose(from, turn, size.set(thick, shaft, thick)));
      from.addScaledVector(along, shaft);
      this.heads.setMatrixAt(drawn, matrix.compose(from, turn, size.setScalar(thick)));
      drawn += 1;
    }
    for (const [mesh, number] of [[this.shafts, drawn], [this.heads, drawn], [this.dots, count]]) {
      if (!mesh) continue;
      mesh.count = number;
      mesh.instanceMatrix.needsUpdate = true;
    }
  }

  visible({ arrows, dots }) {
    this.shafts.visible = this.heads.visible = arrows;
    if (this.dots) this.dots.visible = dots;
  }
};

/** Contacts, frame by frame. */
hydrograd.Contacts = class {
  constructor(data, stage) {
    const { starts, positions, forces, scale, largest } = data.contacts;
    [this.starts, this.positions, this.forces] = [starts, positions, forces].map(hydrograd.decode);
    // An impact may press ten thousand times as hard as what rests: a quarter shorter for every tenth of the largest force.
    const longest = 0.25 * data.size;
    const shortening = (force) => longest * (1 + Math.log10(force / largest) / 4);
    this.length = scale === null ? shortening : (force) => Math.min(scale * force, data.size);
    let most = 0;
    for (let f = 0; f + 1 < this.starts.length; f++) most = Math.max(most, this.starts[f + 1] - this.starts[f]);
    const look = { thickness: 0.006 * data.size, color: 0xc81e2b, on_top: true, dots: 0x2b1718 };
    this.arrows = new hydrograd.Arrows(stage.world, most, look);
  }

  get any() {
    return this.positions.length > 0;
  }

  /** Shows those of a frame; gives how many there are and the largest force, N. */
  place(frame) {
    const [from, to] = [this.starts[frame], this.starts[frame + 1]];
    const where = { length: this.length, points_from: 3 * from, vectors_from: 3 * from };
    this.arrows.show(this.positions, this.forces, to - from, where);
    let largest = 0;
    for (let i = from; i < to; i++) largest = Math.max(largest, Math.hypot(...this.forces.subarray(3 * i, 3 * i + 3)));
    return { count: to - from, largest };
  }
};

/** The water's velocity at given points, frame by frame. */
hydrograd.Flow = class {
  constructor(data, stage) {
    const { points, velocities, scale, longest } = data.flow;
    [this.points, this.velocities] = [points, velocities].map(hydrograd.decode);
    // Where it isn't known it is written as nothing, and no arrow is drawn.
    Object.assign(this, { scale, longest });
    this.length = (speed) => (scale * speed < 0.03 * longest ? 0 : Math.min(scale * speed, longest));
    const look = { thickness: 0.06 * longest, color: 0x0f5f8c, on_top: false };
    this.arrows = new hydrograd.Arrows(stage.world, this.count, look);
  }

  get count() {
    return this.points.length / 3;
  }

  /** Shows that of a frame; gives the largest speed, m/s. */
  place(frame) {
    const from = 3 * this.count * frame;
    this.arrows.show(this.points, this.velocities, this.count, { length: this.length, vectors_from: from });
    let largest = 0;
    for (let i = from; i < from + 3 * this.count; i += 3) {
      largest = Math.max(largest, Math.hypot(...this.velocities.subarray(i, i + 3)));
    }
    return largest;
  }
};

/** The force of the flow on each body, frame by frame. */
hydrograd.Forces = class {
  constructor(data, groups, stage) {
    this.groups = groups;
    this.forces = hydrograd.decode(data.forces.forces); // (frames, bodies, 3), N
    const { largest } = data.forces;
    this.largest = largest; // of the rollout, N
    this.length = (force) => (largest > 0 ? (0.25 * data.size * force) / largest : 0);
    const look = { thickness: 0.006 * data.size, color: 0x6a1b9a, on_top: true };
    this.arrows = new hydrograd.Arrows(stage.world, groups.length, look);
  }

  /** Shows those of a frame where the bodies are now; gives the largest, N. */
  place(frame) {
    const count = this.groups.length;
    const from = 3 * count * frame;
    const points = this.groups.flatMap(({ position }) => position.toArray());
    this.arrows.show(points, this.forces, count, { length: this.length, vectors_from: from });
    let largest = 0;
    for (let i = from; i < from + 3 * count; i += 3) largest = Math.max(largest, Math.hypot(...this.forces.subarray(i, i + 3)));
    return largest;
  }
};
