// Lines along the water's velocity at a moment: the darker the faster, with a head in the middle of each.
"use strict";

hydrograd.Streamlines = class {
  constructor(data, stage) {
    const { points, speeds, lines, frames, fastest } = data.streamlines;
    this.points = hydrograd.decode(points); // (all, 3), m, from the scene's centre
    this.speeds = hydrograd.decode(speeds); // (all), m/s
    this.lines = hydrograd.decode(lines); // where each line's points begin, and their end
    this.frames = hydrograd.decode(frames); // where each frame's lines begin, and their end
    this.fastest = fastest; // of the rollout, m/s
    let [segments, count] = [0, 0];
    for (let f = 0; f + 1 < this.frames.length; f++) {
      const [from, to] = [this.frames[f], this.frames[f + 1]];
      count = Math.max(count, to - from);
      segments = Math.max(segments, this.lines[to] - this.lines[from] - (to - from));
    }
    const geometry = new THREE.BufferGeometry();
    this.ends = new THREE.BufferAttribute(new Float32Array(6 * segments), 3);
    this.ink = new THREE.BufferAttribute(new Float32Array(8 * segments), 4);
    geometry.setAttribute("position", this.ends);
    geometry.setAttribute("color", this.ink);
    const material = new THREE.LineBasicMaterial({ vertexColors: true, transparent: true, depthWrite: false });
    this.mesh = new THREE.LineSegments(geometry, material);
    this.mesh.frustumCulled = false;
    stage.world.add(this.mesh);
    this.color = new THREE.Color(0x0f5f8c);
    this.arrows = new hydrograd.Arrows(stage.world, count, { thickness: 0.004 * data.size, color: 0x0f5f8c, on_top: false });
    this.head = 3.61 * this.arrows.thickness; // hardly longer than the head alone
  }

  /** Shows those of a frame; gives how many there are. */
  place(frame) {
    const { r, g, b } = this.color;
    const [from, to] = [this.frames[frame], this.frames[frame + 1]];
    const [places, along] = [[], []];
    let at = 0;
    const put = (i) => {
      this.ends.array.set(this.points.subarray(3 * i, 3 * i + 3), 3 * at);
      this.ink.array.set([r, g, b, 0.2 + 0.8 * Math.sqrt(this.speeds[i] / this.fastest)], 4 * at);
      at += 1;
    };
    for (let line = from; line < to; line++) {
      const [first, end] = [this.lines[line], this.lines[line + 1]];
      for (let i = first; i + 1 < end; i++) [i, i + 1].forEach(put);
      const middle = 3 * Math.floor((first + end - 1) / 2);
      const p = this.points.subarray(middle, middle + 6);
      places.push(p[0], p[1], p[2]);
      along.push(p[3] - p[0], p[4] - p[1], p[5] - p[2]);
    }
    this.ends.needsUpdate = this.ink.needsUpdate = true;
    this.mesh.geometry.setDrawRange(0, at);
    this.arrows.show(places, along, to - from, { length: () => this.head });
    return to - from;
  }

  visible(shown) {
    this.mesh.visible = shown;
    this.arrows.visible({ arrows: shown });
  }
};
