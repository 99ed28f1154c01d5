// The water's pressure on the bodies: each face in one colour.
"use strict";

/** Colours from the lowest pressure by none to the highest, told apart also by most who see few colours. */
const DIVERGING = ["#2166ac", "#92c5de", "#f7f7f7", "#f4a582", "#b2182b"];

/** What they are multiplied with on the stage: in full light a face is as bright as in the legend, and none is white for being lit. */
const DIMMED = 0xdadada;

/** `count` colours along those, each as red, green and blue from 0 to 255. */
hydrograd.diverging = (count) => {
  const stops = DIVERGING.map((stop) => [1, 3, 5].map((at) => parseInt(stop.slice(at, at + 2), 16)));
  return Array.from({ length: count }, (_, i) => {
    const at = (i / (count - 1)) * (stops.length - 1);
    const from = Math.min(Math.floor(at), stops.length - 2);
    return stops[from].map((part, k) => Math.round(part + (at - from) * (stops[from + 1][k] - part)));
  });
};

hydrograd.Pressure = class {
  /** On the surfaces of `groups`, those of the bodies. */
  constructor({ bodies, scale, steps, ends, hydrostatic }, groups) {
    Object.assign(this, { scale, steps, hydrostatic, frame: -1 });
    this.ends = hydrograd.decode(ends); // (frames, 2), Pa: the lowest and the highest
    this.colors = hydrograd.diverging(2 * steps + 1).map((rgb) => new THREE.Color(`rgb(${rgb})`));
    this.skins = bodies.map(({ body, codes }) => {
      const { skin } = groups[body].userData;
      // No two faces share a corner there.
      const corners = skin.geometry.getAttribute("position").count;
      const paint = new THREE.BufferAttribute(new Float32Array(3 * corners), 3);
      skin.geometry.setAttribute("color", paint);
      return { material: skin.material, own: skin.material.color.clone(), paint, faces: corners / 3, codes: hydrograd.decode(codes) };
    });
  }

  get any() {
    return this.skins.length > 0;
  }

  get name() {
    return this.hydrostatic ? "pressure and hydrostatic" : "pressure of the flow";
  }

  /** Shows those of a frame; gives the lowest and the highest, Pa. */
  place(frame) {
    if (frame !== this.frame) {
      for (const { own, paint, faces, codes } of this.skins) {
        for (let face = 0; face < faces; face++) {
          // Beyond the colours is what isn't known.
          const color = this.colors[codes[frame * faces + face] + this.steps] || own;
          for (let corner = 0; corner < 3; corner++) color.toArray(paint.array, 9 * face + 3 * corner);
        }
        paint.needsUpdate = true;
      }
      this.frame = frame;
    }
    return this.ends.subarray(2 * frame, 2 * frame + 2);
  }

  /** Faces in these colours, or bodies in their own. */
  show(shown) {
    for (const { material, own } of this.skins) {
      material.vertexColors = shown;
      if (shown) material.color.set(DIMMED);
      else material.color.copy(own);
      material.needsUpdate = true;
    }
  }

  /** Colours and what they stand for, in an element of the panel. */
  legend(element) {
    const bar = document.createElement("div");
    bar.className = "bar";
    bar.style.background = `linear-gradient(to right, ${DIVERGING})`;
    const numbers = document.createElement("div");
    numbers.className = "ends";
    const ends = [`≤ ${hydrograd.figure(-this.scale)}`, "0", `≥ ${hydrograd.figure(this.scale)} Pa`];
    numbers.append(...ends.map((text) => Object.assign(document.createElement("span"), { textContent: text })));
    element.replaceChildren(bar, numbers);
  }
};
