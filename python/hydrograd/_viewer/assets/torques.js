// Torques of the flow on bodies: an arc about the torque's axis, from which its head goes on as fingers do where the thumb is the axis.
"use strict";

/** How far an arc goes round, rad. */
const ROUND = 1.5 * Math.PI;
/** Its thickness in its radius. */
const THICK = 0.09;

/** A rod bent round z with radius 1, and the head at its end. */
hydrograd.arc = () => {
  // Along y from 0 to 1, as three.js makes them.
  const rod = new THREE.CylinderGeometry(THICK / 2, THICK / 2, 1, 8, 48).translate(0, 0.5, 0);
  const place = rod.getAttribute("position");
  for (let i = 0; i < place.count; i++) {
    const [angle, radius] = [ROUND * place.getY(i), 1 + place.getX(i)];
    place.setXYZ(i, radius * Math.cos(angle), radius * Math.sin(angle), place.getZ(i));
  }
  const head = new THREE.ConeGeometry(1.6 * THICK, 4 * THICK, 12).translate(0, 2 * THICK, 0);
  return [rod, head.rotateZ(ROUND).translate(Math.cos(ROUND), Math.sin(ROUND), 0)];
};

/** The torque of the flow on each body, frame by frame. */
hydrograd.Torques = class {
  constructor(data, groups, stage) {
    this.groups = groups;
    this.torques = hydrograd.decode(data.forces.torques); // (frames, bodies, 3), N m, about the bodies' origins
    this.largest = data.forces.largest_torque; // of the rollout, N m
    this.widest = 0.12 * data.size; // m
    const look = { color: 0xc2571a, on_top: true };
    this.meshes = hydrograd.arc().map((part) => hydrograd.instances(stage.world, groups.length, part, look));
  }

  /** Shows those of a frame where the bodies are now; gives the largest, N m. */
  place(frame) {
    const count = this.groups.length;
    const [axis, forward] = [new THREE.Vector3(), new THREE.Vector3(0, 0, 1)];
    const [turn, matrix, size] = [new THREE.Quaternion(), new THREE.Matrix4(), new THREE.Vector3()];
    let [largest, drawn] = [0, 0];
    this.groups.forEach(({ position }, body) => {
      const torque = axis.fromArray(this.torques, 3 * (count * frame + body)).length();
      largest = Math.max(largest, torque);
      // An arc smaller than a hundredth of the widest can't be told from a dot.
      if (!(torque > 0.01 * this.largest)) return;
      turn.setFromUnitVectors(forward, axis.divideScalar(torque));
      matrix.compose(position, turn, size.setScalar((this.widest * torque) / this.largest));
      this.meshes.forEach((mesh) => mesh.setMatrixAt(drawn, matrix));
      drawn += 1;
    });
    for (const mesh of this.meshes) {
      mesh.count = drawn;
      mesh.instanceMatrix.needsUpdate = true;
    }
    return largest;
  }

  visible(shown) {
    for (const mesh of this.meshes) mesh.visible = shown;
  }
};
