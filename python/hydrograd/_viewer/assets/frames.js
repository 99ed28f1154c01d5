// The recorded frames: arrays out of the page's data, and poses between frames.
"use strict";

/** A typed array from its parts: type, and numbers as base64, little end first. */
hydrograd.decode = ({ type, data }) => {
  const bytes = Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0));
  const kinds = { f4: Float32Array, f8: Float64Array, i4: Int32Array, i1: Int8Array };
  return new kinds[type](bytes.buffer);
};

hydrograd.Frames = class {
  constructor(data) {
    this.time = hydrograd.decode(data.time); // (frames), s
    this.steps = hydrograd.decode(data.steps); // (frames)
    this.bodies = data.bodies.length;
    this.positions = hydrograd.decode(data.positions); // (frames, bodies, 3), m, from the scene's centre
    this.rotations = hydrograd.decode(data.rotations); // (frames, bodies, 4), quaternions x, y, z, w, body to world
  }

  get count() {
    return this.time.length;
  }

  get first() {
    return this.time[0];
  }

  get last() {
    return this.time[this.count - 1];
  }

  /** The frame at or before a time, and how far it is to the next one, 0 to 1. */
  locate(time) {
    // What lies before a frame by rounding alone is that frame.
    const t = Math.min(Math.max(time, this.first) + 1e-9 * (this.last - this.first), this.last);
    let [low, high] = [0, this.count - 1];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.time[middle] <= t) low = middle;
      else high = middle;
    }
    if (t >= this.time[high]) return { frame: high, share: 0 };
    return { frame: low, share: Math.max(time - this.time[low], 0) / (this.time[high] - this.time[low]) };
  }

  /** Writes the pose of a body: straight between positions, along the shortest turn between rotations. */
  pose(body, { frame, share }, position, rotation) {
    const at = frame * this.bodies + body;
    position.fromArray(this.positions, 3 * at);
    rotation.fromArray(this.rotations, 4 * at);
    if (share > 0) {
      const next = at + this.bodies;
      const p = this.positions;
      position.x += share * (p[3 * next] - position.x);
      position.y += share * (p[3 * next + 1] - position.y);
      position.z += share * (p[3 * next + 2] - position.z);
      rotation.slerp(new THREE.Quaternion().fromArray(this.rotations, 4 * next), share);
    }
  }
};
